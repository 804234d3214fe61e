#include "scene_check.h"

#include "semblance/core/errors.h"

namespace semblance {

void check_renderable(const Scene& scene, const Camera& camera) {
  if (camera.width <= 0 || camera.height <= 0)
    throw InvalidInput("camera '" + camera.name + "' has no pixels: expected a positive size");
  if (camera.lens != Camera::Lens::pinhole)
    throw InvalidInput(
        "camera '" + camera.name +
        "' has lens distortion: draw with without_distortion() and warp the picture");
  for (const SceneObject& object : scene.objects) {
    if (object.mesh == nullptr) throw InvalidInput("object '" + object.name + "' has no mesh");
    if (object.positions_m.rows() != object.mesh->vertex_count())
      throw InvalidInput("object '" + object.name + "' has " +
                         std::to_string(object.positions_m.rows()) + " positions: expected " +
                         std::to_string(object.mesh->vertex_count()) +
                         ", one per vertex of its mesh");
  }
}

}  // namespace semblance
