// Other programs, run without a shell.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace semblance {

/// Where the program of this name is, by PATH; none where it is not installed.
std::optional<std::filesystem::path> find_program(const std::string& name);

/// Runs a program to its end and gives its exit status; -1 if a signal or `cancelled` ended it. The
/// arguments reach it as they are. What it prints is added to the file `log`. It sees no display
/// (QT_QPA_PLATFORM=offscreen). Throws IoError if it cannot be started.
int run_program(const std::filesystem::path& program, const std::vector<std::string>& arguments,
                const std::filesystem::path& log, const std::function<bool()>& cancelled = {});

}  // namespace semblance
