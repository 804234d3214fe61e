// The camera object of camera files, rigs and track headers.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "semblance/core/camera.h"
#include "semblance/io/camera_rig.h"

namespace semblance {

nlohmann::ordered_json json_from_camera(const Camera& camera);
/// Throws InvalidInput that lists every problem, naming `source` and the keys.
Camera camera_from_json(const nlohmann::json& json, const std::string& source);
/// The same for a rig, or a single camera.
CameraRig rig_from_json(const nlohmann::json& json, const std::string& source);

}  // namespace semblance
