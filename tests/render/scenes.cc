#include "scenes.h"

#include <cmath>

#include "semblance/core/random.h"

namespace semblance::testing {

SceneObject make_object(const std::string& name, const PointsF& positions_m,
                        const Triangles& triangles) {
  auto mesh = std::make_shared<Mesh>();
  mesh->positions_m = positions_m.cast<double>();
  mesh->triangles = triangles;
  SceneObject object;
  object.name = name;
  object.positions_m = positions_m;
  vertex_normals(positions_m, triangles, object.normals);
  object.mesh = mesh;
  return object;
}

SceneObject make_grid(const std::string& name, int columns, int rows,
                      const std::function<Eigen::Vector3f(float, float)>& point) {
  PointsF positions((columns + 1) * (rows + 1), 3);
  Eigen::Matrix<float, Eigen::Dynamic, 2, Eigen::RowMajor> uvs(positions.rows(), 2);
  Triangles triangles(2 * columns * rows, 3);
  for (int r = 0, v = 0; r <= rows; ++r) {
    for (int c = 0; c <= columns; ++c, ++v) {
      uvs.row(v) << static_cast<float>(c) / static_cast<float>(columns),
          static_cast<float>(r) / static_cast<float>(rows);
      positions.row(v) = point(uvs(v, 0), uvs(v, 1));
    }
  }
  for (int r = 0, t = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      const int a = r * (columns + 1) + c, b = a + columns + 1;
      triangles.row(t++) << a, a + 1, b;
      triangles.row(t++) << a + 1, b + 1, b;
    }
  }
  SceneObject object = make_object(name, positions, triangles);
  auto mesh = std::make_shared<Mesh>(*object.mesh);
  mesh->uvs = uvs;
  object.mesh = mesh;
  return object;
}

SceneObject make_ellipsoid(int columns, int rows, float distance_m) {
  return make_grid("ellipsoid", columns, rows, [&](float u, float v) {
    const float longitude = 2.0f * static_cast<float>(M_PI) * u;
    const float latitude = static_cast<float>(M_PI) * (v - 0.5f);
    return Eigen::Vector3f(0.09f * std::cos(latitude) * std::sin(longitude),
                           0.11f * std::sin(latitude),
                           0.1f * std::cos(latitude) * std::cos(longitude) - distance_m);
  });
}

std::shared_ptr<const Image> make_texture(int width, int height) {
  auto image = std::make_shared<Image>(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const float u = static_cast<float>(x) / static_cast<float>(width);
      const float v = static_cast<float>(y) / static_cast<float>(height);
      float* pixel = image->pixel(x, y);
      pixel[0] = 0.5f + 0.4f * std::sin(9.0f * u + 3.0f * v);
      pixel[1] = 0.5f + 0.4f * std::sin(7.0f * v - 2.0f * u);
      pixel[2] = 0.5f + 0.4f * std::sin(5.0f * (u + v));
    }
  }
  return image;
}

ShLight make_light() {
  ShLight light;
  for (int k = 0; k < 9; ++k) {
    const auto f = static_cast<float>(k);
    light.coefficients[k] = {0.15f * std::sin(1.0f + f), 0.15f * std::cos(2.0f * f),
                             0.15f * std::sin(3.0f * f + 2.0f)};
  }
  light.coefficients[0] = {0.9f, 0.8f, 0.85f};
  return light;
}

namespace {

Camera small_camera() {
  Camera camera = Camera::centred(201, 151, 260.0);
  camera.focal_px = {260.0, 255.0};
  camera.principal_px = {97.3, 77.9};
  return camera;
}

NamedScene named(const std::string& name, std::vector<SceneObject> objects, double wrong_share) {
  NamedScene result{name, {}, small_camera(), wrong_share};
  result.scene.objects = std::move(objects);
  result.scene.light = make_light();
  result.scene.background = {0.2f, 0.3f, 0.4f};
  return result;
}

SceneObject soup(int count, float size_m, float shift_m, std::uint64_t seed) {
  Random random(seed);
  PointsF positions(3 * count, 3);
  Triangles triangles(count, 3);
  for (int t = 0; t < count; ++t) {
    const Eigen::Vector3d centre(random.uniform(-0.4, 0.4) + shift_m, random.uniform(-0.3, 0.3),
                                 random.uniform(-1.4, -0.7));
    for (int c = 0; c < 3; ++c) {
      const Eigen::Vector3d offset(random.uniform(-1, 1), random.uniform(-1, 1),
                                   random.uniform(-1, 1));
      positions.row(3 * t + c) = (centre + size_m * offset).cast<float>();
    }
    triangles.row(t) << 3 * t, 3 * t + 1, 3 * t + 2;
  }
  return make_object("soup", positions, triangles);
}

}  // namespace

std::vector<NamedScene> scene_catalogue() {
  std::vector<NamedScene> scenes;
  scenes.push_back(named("sphere", {make_ellipsoid(60, 40, 0.35f)}, 0.002));
  PointsF crossing(6, 3);
  crossing << -0.2f, -0.2f, -0.8f, 0.25f, -0.1f, -1.1f, 0.0f, 0.3f, -0.9f,  //
      -0.25f, 0.1f, -1.1f, 0.2f, -0.2f, -0.8f, 0.1f, 0.3f, -0.95f;
  Triangles two(2, 3);
  two << 0, 1, 2, 3, 4, 5;
  scenes.push_back(named("overlapping", {make_object("crossing", crossing, two)}, 0.002));
  scenes.push_back(named("soup", {soup(400, 0.08f, 0.0f, 1)}, 0.002));
  scenes.push_back(named("tiny", {make_ellipsoid(400, 300, 0.45f)}, 0.01));
  scenes.push_back(named("outside", {soup(150, 0.4f, 0.5f, 2)}, 0.002));
  SceneObject near = soup(200, 0.12f, 0.0f, 3);
  near.positions_m.col(2).array() += 0.9f;
  vertex_normals(near.positions_m, near.mesh->triangles, near.normals);
  scenes.push_back(named("near plane", {near}, 0.002));

  SceneObject textured = make_ellipsoid(50, 30, 0.4f),
              backdrop = make_grid("backdrop", 6, 4, [](float u, float v) {
                return Eigen::Vector3f(0.9f * u - 0.45f, 0.7f * v - 0.35f, -0.8f + 0.2f * u);
              });
  textured.material.texture = make_texture(64, 48);
  backdrop.material.texture = make_texture(7, 5);
  SceneObject plain = soup(60, 0.05f, 0.0f, 4);
  plain.positions_m.col(2).array() += 0.4f;
  plain.material.colour = {0.2f, 0.9f, 0.4f};
  scenes.push_back(named("textured", {backdrop, textured, plain}, 0.002));
  Camera& turned = scenes.back().camera;  // and a camera that is not at the origin
  turned.camera_from_world =
      Rigid3{quaternion_from_rotation_vector({0.1, -0.2, 0.3}), {0.02, -0.03, 0.1}} *
      turned.camera_from_world;
  return scenes;
}

}  // namespace semblance::testing
