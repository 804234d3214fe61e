// Scenes of cloth as JSON files (docs/formats/cloth-scene.md).
#pragma once

#include <string>

#include "semblance/cloth/simulation.h"

namespace semblance {

/// Reads a scene. Files that it names are found from its own folder. `fabric` (FILE or FILE:NAME,
/// from the current folder) replaces the scene's where it is not empty. Everything that does not
/// depend on the spacing is checked here. Throws one InvalidInput that lists every problem of the
/// JSON, and InvalidInput or IoError of the files it names.
SimulationSetup read_cloth_scene(const std::string& path, const std::string& fabric = "");

}  // namespace semblance
