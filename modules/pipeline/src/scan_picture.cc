#include "semblance/pipeline/scan_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>

#include "semblance/render/embree_renderer.h"

namespace semblance {

namespace {

using Eigen::Index;

constexpr float background = 1.0f;

/// The map's surface in its own frame: y up, z to the front, the middle at the origin.
Mesh centred_mesh(RangeMap map) {
  map.world_from_map = Rigid3{};
  map.bottom_m = -0.5 * map.spacing_m * static_cast<double>(map.rows() - 1);
  return mesh_from_range_map(map);
}

Image shaded_view(const std::shared_ptr<const Mesh>& mesh, double yaw_rad, int size_px) {
  constexpr double distance_in_extents = 10.0;
  const double extent_m = mesh->positions_m.cwiseAbs().maxCoeff();
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitY()).toRotationMatrix();
  Scene scene;
  SceneObject object;
  object.mesh = mesh;
  object.positions_m = (mesh->positions_m * turn.transpose()).cast<float>();
  vertex_normals(object.positions_m, mesh->triangles, object.normals);
  scene.objects.push_back(std::move(object));
  scene.background.setConstant(background);
  scene.light.coefficients[0].setConstant(0.25f);
  RayTraceOptions options;
  options.samples_per_pixel = 9;
  options.lamp = DirectionalLight{{-0.7, 0.7, 0.9}, Eigen::Vector3f::Constant(0.9f)};
  Camera camera = Camera::centred(size_px, size_px, 0.44 * size_px * distance_in_extents);
  camera.camera_from_world.translation_m.z() += distance_in_extents * extent_m;
  return ray_trace(scene, camera, Channel::colour, options).colour;
}

}  // namespace

Image shaded_views(const RangeMap& map, int height_px) {
  const auto mesh = std::make_shared<const Mesh>(centred_mesh(map));
  constexpr std::array yaws_rad{0.0, std::numbers::pi / 4.0, std::numbers::pi / 2.0};
  Image picture(height_px * static_cast<int>(yaws_rad.size()), height_px, 3, background);
  for (std::size_t k = 0; k < yaws_rad.size(); ++k) {
    const Image view = shaded_view(mesh, yaws_rad[k], height_px);
    for (int y = 0; y < height_px; ++y) {
      std::copy_n(view.pixel(0, y), 3 * height_px,
                  picture.pixel(static_cast<int>(k) * height_px, y));
    }
  }
  return picture;
}

Rgb8 error_picture(const RangeMap& map, const Grid& radius_m, double full_scale_m) {
  Rgb8 picture{static_cast<int>(map.columns()), static_cast<int>(map.rows()), {}};
  const auto level = [](double share) {
    return static_cast<std::uint8_t>(std::lround(255.0 * std::clamp(share, 0.0, 1.0)));
  };
  for (Index row = map.rows() - 1; row >= 0; --row) {
    for (Index column = 0; column < map.columns(); ++column) {
      if (map.samples(row, column) != RangeSample::measured) {
        picture.data.insert(picture.data.end(), 3, 128);
        continue;
      }
      const double error = (radius_m(row, column) - map.radius_m(row, column)) / full_scale_m;
      picture.data.push_back(level(1.0 + error));
      picture.data.push_back(level(1.0 - std::abs(error)));
      picture.data.push_back(level(1.0 - error));
    }
  }
  return picture;
}

}  // namespace semblance
