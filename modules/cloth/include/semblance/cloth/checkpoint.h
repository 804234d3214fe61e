// Checkpoints of simulations, as files.
#pragma once

#include <string>
#include <string_view>

#include "semblance/cloth/simulation.h"

namespace semblance {

/// Bytes of a checkpoint: a version, little-endian numbers, and a sum over all bytes at the end.
std::string format_checkpoint(const SimulationCheckpoint& checkpoint);
/// Throws InvalidInput, naming `source`, for anything else: another version, a size that does not
/// fit what is there, a wrong sum.
SimulationCheckpoint parse_checkpoint(std::string_view bytes, const std::string& source);

/// Writes under a temporary name and renames. Throws IoError.
void write_checkpoint(const std::string& path, const SimulationCheckpoint& checkpoint);
SimulationCheckpoint read_checkpoint(const std::string& path);

}  // namespace semblance
