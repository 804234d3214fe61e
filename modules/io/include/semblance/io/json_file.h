// JSON files, read with bounds.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace semblance {

/// Parses `text`. Throws InvalidInput, naming `source` and the place, where it is not JSON, nests
/// deeper than 64 levels, or holds a key twice in one object.
nlohmann::json parse_json(std::string_view text, const std::string& source);
/// The same for a file of at most 256 MiB; IoError if it cannot be read.
nlohmann::json read_json_file(const std::string& path);

}  // namespace semblance
