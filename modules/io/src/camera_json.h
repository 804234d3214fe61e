// The camera object of camera files and track headers.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "semblance/core/camera.h"

namespace semblance {

nlohmann::ordered_json json_from_camera(const Camera& camera);
/// Throws InvalidInput that lists every problem, naming `source` and the keys.
Camera camera_from_json(const nlohmann::json& json, const std::string& source);

}  // namespace semblance
