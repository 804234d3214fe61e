// Several cameras in one world, and this program's file of them, semblance.rig/1
// (docs/formats/camera.md).
#pragma once

#include <string>
#include <vector>

#include "semblance/core/camera.h"

namespace semblance {

/// Cameras that share a world. Their names tell them apart.
struct CameraRig {
  std::vector<Camera> cameras;
};

/// Throws InvalidInput, naming `source`, unless there is a camera, all are valid, and no two have
/// the same name.
void validate(const CameraRig& rig, const std::string& source);

/// Reads semblance.rig/1, or semblance.camera/1 as a rig of one. Throws InvalidInput that lists
/// every problem with file and key.
CameraRig read_rig(const std::string& path);
/// Writes semblance.rig/1.
void write_rig(const std::string& path, const CameraRig& rig);

}  // namespace semblance
