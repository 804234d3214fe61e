#include "scene_check.h"

#include "semblance/core/errors.h"

namespace semblance {

void check_renderable(const Scene& scene, const Camera& camera) {
  if (camera.width <= 0 || camera.height <= 0)
    throw InvalidInput("camera '" + camera.name + "' has no pixels: expected a positive size");
  if (camera.lens != Lens::pinhole)
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

void check_shadable(const Scene& scene, Channel channels) {
  const bool colour = has(channels, Channel::colour);
  if (!colour && !has(channels, Channel::normal)) return;
  for (const SceneObject& object : scene.objects) {
    if (object.normals.rows() != object.positions_m.rows())
      throw InvalidInput("object '" + object.name + "' has " +
                         std::to_string(object.normals.rows()) + " normals: expected " +
                         std::to_string(object.positions_m.rows()) + ", one per vertex");
    const Image* texture = object.material.texture.get();
    if (!colour || texture == nullptr) continue;
    if (texture->channels != 3 || texture->empty())
      throw InvalidInput("the texture of object '" + object.name + "' has " +
                         std::to_string(texture->channels) + " channels: expected 3, linear RGB");
    if (object.mesh->uvs.rows() != object.positions_m.rows())
      throw InvalidInput("object '" + object.name +
                         "' has a texture but no texture coordinates for its vertices");
  }
}

}  // namespace semblance
