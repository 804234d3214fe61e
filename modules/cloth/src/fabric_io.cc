#include "semblance/cloth/fabric_io.h"

#include <fmt/format.h>

#include <filesystem>

#include "csv_rows.h"
#include "fabric_parts.h"
#include "semblance/core/errors.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

/// "fabrics.csv:denim A" is a file and a name, unless there is such a file.
void split_name(std::string& path, std::string& name) {
  std::error_code error;
  const std::size_t colon = path.rfind(".csv:");
  if (colon == std::string::npos || std::filesystem::exists(path, error)) return;
  if (!name.empty()) {
    throw InvalidInput(path + ": the name of the fabric is given twice, here and apart");
  }
  name = path.substr(colon + 5);
  path.resize(colon + 4);
}

void check_name(const FabricRecord& record, const std::string& path, const std::string& name) {
  if (name.empty() || name == record.fabric.name) return;
  throw InvalidInput(fmt::format("{}: holds the one fabric {}, not {}", path,
                                 text::quoted(record.fabric.name), text::quoted(name)));
}

}  // namespace

FabricRecord parse_fabric_csv(std::string_view content, const std::string& source,
                              const std::string& name) {
  CsvRows rows(content, source);
  std::vector<std::string_view> fields;
  if (!rows.next(fields)) throw InvalidInput(source + ": is empty (docs/formats/fabric.md)");
  if (fields[0] == "fabric") return parse_fabric_figures(content, source, name);
  FabricRecord record = parse_fabric_curves(content, source);
  check_name(record, source, name);
  return record;
}

FabricRecord read_fabric_record(const std::string& given_path, const std::string& given_name) {
  constexpr std::uintmax_t limit_bytes = std::uintmax_t{16} << 20;
  std::string path = given_path, name = given_name;
  split_name(path, name);
  const std::string extension = text::lower_extension(path);
  if (extension == ".csv") return parse_fabric_csv(text::read_file(path, limit_bytes), path, name);
  if (extension != ".json") {
    throw InvalidInput(path + ": fabrics are read from .json or .csv files");
  }
  FabricRecord record = parse_fabric_json(text::read_file(path, limit_bytes), path);
  check_name(record, path, name);
  return record;
}

Fabric read_fabric(const std::string& path, const std::string& name) {
  return read_fabric_record(path, name).fabric;
}

}  // namespace semblance
