// Options that the commands about scans share.
#pragma once

#include <CLI/CLI.hpp>

#include "semblance/pipeline/scan_reconstruction.h"

namespace semblance::cli {

/// How a mesh is scanned. The result takes what the parser reads.
void add_scan_options(CLI::App& command, MeshScanOptions& options);

void add_encoding_option(CLI::App& command, RangeEncoding& encoding);

}  // namespace semblance::cli
