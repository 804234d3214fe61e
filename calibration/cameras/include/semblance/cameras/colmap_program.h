// Photos without marks: cameras by COLMAP's program.
#pragma once

#include <string>
#include <vector>

#include "semblance/core/progress.h"
#include "semblance/io/colmap.h"

namespace semblance {

/// Runs COLMAP's sparse reconstruction (features, matches of all pairs, mapper; on the CPU, without
/// a display) on photos that one camera took at one zoom, in the folder `workspace`, which keeps
/// its database and log. Images of the result have the names given here; those that found no place
/// are absent. Its unit of length is arbitrary. Schoenberger and Frahm, "Structure-from-Motion
/// Revisited", CVPR 2016.
///
/// `camera_model` is COLMAP's name of the lens ("PINHOLE", "OPENCV"). COLMAP decides by chance at
/// places; with its fixed seed, results agree to within its tolerances, not to the bit.
///
/// Throws InvalidInput where the program is not installed, with the remedy, and for less than three
/// photos; SolverError, naming its log, where it finds no model.
ColmapModel reconstruct_with_colmap(const std::vector<std::string>& photos,
                                    const std::string& camera_model, const std::string& workspace,
                                    Progress& progress);

}  // namespace semblance
