// Bounded reading of YAML with yaml-cpp.
#pragma once

#include <yaml-cpp/yaml.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace semblance::yaml {

bool is_yaml(const std::string& path);

/// Throws InvalidInput, naming `source` and the line, for what is not YAML. OpenCV's first line
/// (%YAML:1.0), which is none, is passed over.
YAML::Node parse(std::string_view content, const std::string& source);

/// A list of finite numbers, or of such lists one after the other; nothing for anything else.
std::optional<std::vector<double>> numbers(const YAML::Node& node);

}  // namespace semblance::yaml
