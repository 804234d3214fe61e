#include "yaml.h"

#include <fmt/format.h>

#include "semblance/core/errors.h"
#include "semblance/io/text.h"

namespace semblance::yaml {
namespace {

bool append(const YAML::Node& node, std::vector<double>& values) {
  // Aliases make short texts of long lists.
  constexpr std::size_t most = 1000000;
  double value = 0.0;
  if (values.size() == most || !node.IsScalar() || !text::parse(node.Scalar(), value)) return false;
  values.push_back(value);
  return true;
}

}  // namespace

bool is_yaml(const std::string& path) {
  const std::string extension = text::lower_extension(path);
  return extension == ".yaml" || extension == ".yml";
}

YAML::Node parse(std::string_view content, const std::string& source) {
  int lines_before = 0;
  if (content.substr(0, 5) == "%YAML") {
    const std::size_t end = content.find('\n');
    content.remove_prefix(end == std::string_view::npos ? content.size() : end + 1);
    lines_before = 1;
  }
  try {
    return YAML::Load(std::string(content));
  } catch (const YAML::Exception& error) {
    throw InvalidInput(fmt::format("{}: is not valid YAML at line {}: {}", source,
                                   error.mark.line + 1 + lines_before, error.msg));
  }
}

std::optional<std::vector<double>> numbers(const YAML::Node& node) {
  std::vector<double> values;
  if (!node.IsSequence()) return std::nullopt;
  for (const YAML::Node& entry : node) {
    if (!entry.IsSequence()) {
      if (!append(entry, values)) return std::nullopt;
      continue;
    }
    for (const YAML::Node& inner : entry) {
      if (!append(inner, values)) return std::nullopt;
    }
  }
  return values;
}

}  // namespace semblance::yaml
