// Ray-traced pictures of a known object before clutter, with exact truth.
#pragma once

#include <cmath>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "semblance/core/random.h"
#include "semblance/object/object_calibration.h"
#include "semblance/render/embree_renderer.h"

namespace semblance::testing {

/// A lump of about 20 cm without symmetry: a sphere with bumps and hollows. Its seam and its poles
/// have vertices of their own, as scans have.
inline Mesh lump_mesh(int columns = 96, int rows = 64) {
  struct Bump {
    double yaw, pitch, height, width;
  };
  constexpr Bump bumps[] = {{0.2, 0.1, 0.45, 0.35}, {1.9, 0.6, 0.25, 0.5},  {-1.2, -0.5, 0.3, 0.4},
                            {2.8, -0.4, 0.2, 0.6},  {0.9, -0.8, 0.3, 0.35}, {-0.6, 0.8, 0.22, 0.3},
                            {-2.3, 0.3, -0.2, 0.4}, {0.6, 0.6, -0.15, 0.25}};
  Mesh mesh;
  mesh.positions_m.resize((columns + 1) * (rows + 1), 3);
  mesh.uvs.resize(mesh.positions_m.rows(), 2);
  for (int r = 0, v = 0; r <= rows; ++r) {
    for (int c = 0; c <= columns; ++c, ++v) {
      // The last column is the first one again, to the bit.
      const double yaw = 2.0 * std::numbers::pi * (c % columns) / columns;
      const double pitch = std::numbers::pi * (static_cast<double>(r) / rows - 0.5);
      Eigen::Vector3d direction(std::sin(yaw) * std::cos(pitch), std::sin(pitch),
                                std::cos(yaw) * std::cos(pitch));
      if (r == 0 || r == rows) direction = {0.0, r == 0 ? -1.0 : 1.0, 0.0};
      double radius_m = 0.09;
      for (const Bump& bump : bumps) {
        const Eigen::Vector3d axis(std::sin(bump.yaw) * std::cos(bump.pitch), std::sin(bump.pitch),
                                   std::cos(bump.yaw) * std::cos(bump.pitch));
        const double angle = std::acos(std::clamp(axis.dot(direction), -1.0, 1.0)) / bump.width;
        radius_m += 0.09 * bump.height * std::exp(-angle * angle);
      }
      mesh.positions_m.row(v) = (radius_m * direction).transpose();
      mesh.uvs.row(v) << static_cast<float>(c) / static_cast<float>(columns),
          static_cast<float>(r) / static_cast<float>(rows);
    }
  }
  std::vector<Eigen::RowVector3i> faces;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      const int a = r * (columns + 1) + c, b = a + 1, d = a + columns + 1, e = d + 1;
      if (r > 0) faces.push_back({a, b, e});
      if (r + 1 < rows) faces.push_back({a, e, d});
    }
  }
  mesh.triangles.resize(static_cast<Eigen::Index>(faces.size()), 3);
  for (std::size_t t = 0; t < faces.size(); ++t) {
    mesh.triangles.row(static_cast<Eigen::Index>(t)) = faces[t];
  }
  return mesh;
}

/// Blots of random colours over a ground.
inline Image blotted_texture(int size, int blots, double largest, std::uint64_t seed) {
  Random random(seed);
  Image out(size, size, 3, 0.35f);
  for (int i = 0; i < blots; ++i) {
    const double x = random.uniform() * size, y = random.uniform() * size,
                 r = (0.1 + random.uniform()) * largest * size;
    const float colour[] = {static_cast<float>(random.uniform(0.1, 0.8)),
                            static_cast<float>(random.uniform(0.1, 0.8)),
                            static_cast<float>(random.uniform(0.1, 0.8))};
    for (int v = std::max(0, static_cast<int>(y - r)); v < std::min<double>(size, y + r); ++v) {
      for (int u = std::max(0, static_cast<int>(x - r)); u < std::min<double>(size, x + r); ++u) {
        const double d = std::hypot(u + 0.5 - x, v + 0.5 - y) / r;
        const auto share = static_cast<float>(std::clamp(4.0 * (1.0 - d), 0.0, 1.0));
        for (int c = 0; c < 3; ++c) {
          float& value = out.pixel(u, v)[c];
          value += share * (colour[c] - value);
        }
      }
    }
  }
  return out;
}

struct ObjectSceneOptions {
  bool textured = true;
  bool clutter = true;
  double noise = 0.01;    // of the sRGB-encoded intensity
  double click_px = 4.0;  // deviation of a coordinate of a pair
  int pairs = 8;
  bool mask = false;
  double lamp = 0.6;  // its share of the light
  bool shadows = true;
};

/// What is in front of a test's camera, drawn by rays.
class ObjectScene {
 public:
  ObjectScene(Mesh mesh, Image texture, ObjectSceneOptions options)
      : mesh_(std::make_shared<Mesh>(std::move(mesh))),
        texture_(std::make_shared<Image>(std::move(texture))),
        wall_texture_(std::make_shared<Image>(blotted_texture(512, 900, 0.05, 77))),
        options_(options) {}

  const Mesh& mesh() const { return *mesh_; }
  const Image& texture() const { return *texture_; }

  ObjectPicture picture(const Camera& camera, const Rigid3& camera_from_object,
                        std::uint64_t seed) const {
    Scene scene;
    scene.objects.push_back(posed(camera_from_object));
    if (options_.clutter) scene.objects.push_back(wall(3.0 * camera_from_object.translation_m.z()));
    scene.background = {0.55f, 0.6f, 0.65f};
    for (int c = 0; c < 3; ++c) {
      scene.light.coefficients[0][c] = 0.45f;
      scene.light.coefficients[1][c] = -0.08f;  // from above
    }
    RayTraceOptions rays;
    rays.samples_per_pixel = 16;
    rays.seed = seed;
    rays.lamp =
        DirectionalLight{.towards_light = {-0.5, -0.7, -0.8},
                         .radiance = Eigen::Vector3f::Constant(static_cast<float>(options_.lamp)),
                         .shadows = options_.shadows};
    const Frame frame = ray_trace(scene, camera, Channel::colour | Channel::triangle, rays);
    ObjectPicture out;
    out.name = std::string("picture").append(std::to_string(seed));
    out.linear = exposed(frame.colour, seed);
    if (options_.mask) out.mask = mask_of(frame);
    out.pairs = pairs(camera, camera_from_object, frame, seed);
    return out;
  }

 private:
  SceneObject posed(const Rigid3& pose) const {
    SceneObject object;
    object.name = "object";
    object.mesh = mesh_;
    object.positions_m.resize(mesh_->vertex_count(), 3);
    for (Eigen::Index v = 0; v < mesh_->vertex_count(); ++v) {
      const Eigen::Vector3d point = mesh_->positions_m.row(v);
      object.positions_m.row(v) = (pose * point).cast<float>();
    }
    vertex_normals(object.positions_m, mesh_->triangles, object.normals);
    if (options_.textured) {
      object.material.texture = texture_;
    } else {
      object.material.colour = {0.62f, 0.5f, 0.4f};
    }
    return object;
  }

  SceneObject wall(double depth_m) const {
    auto mesh = std::make_shared<Mesh>();
    const double half = 1.5 * depth_m;
    mesh->positions_m.resize(4, 3);
    mesh->positions_m << -half, -half, depth_m, half, -half, depth_m, half, half, depth_m, -half,
        half, depth_m;
    mesh->triangles.resize(2, 3);
    mesh->triangles << 0, 2, 1, 0, 3, 2;
    mesh->uvs.resize(4, 2);
    mesh->uvs << 0, 1, 1, 1, 1, 0, 0, 0;
    SceneObject object;
    object.name = "wall";
    object.mesh = mesh;
    object.positions_m = mesh->positions_m.cast<float>();
    vertex_normals(object.positions_m, mesh->triangles, object.normals);
    object.material.texture = wall_texture_;
    return object;
  }

  /// As a camera of 8 bits would have it.
  Image exposed(const Image& linear, std::uint64_t seed) const {
    Random random(seed, 1);
    Image out = linear;
    for (float& value : out.data) {
      const double encoded = std::sqrt(std::max(value, 0.0f)) + options_.noise * random.normal();
      const double level = std::round(255.0 * std::clamp(encoded, 0.0, 1.0)) / 255.0;
      value = static_cast<float>(level * level);
    }
    return out;
  }

  Image mask_of(const Frame& frame) const {
    Image out(frame.width, frame.height, 3, 0.0f);
    for (std::size_t i = 0; i < frame.triangle.size(); ++i) {
      if (frame.triangle[i] >= 0 && frame.triangle[i] < mesh_->triangle_count()) {
        for (std::size_t c = 0; c < 3; ++c) out.data[3 * i + c] = 1.0f;
      }
    }
    return out;
  }

  /// Vertices of triangles that random pixels show, clicked beside.
  std::vector<ObjectPair> pairs(const Camera& camera, const Rigid3& pose, const Frame& frame,
                                std::uint64_t seed) const {
    Random random(seed, 2);
    std::vector<ObjectPair> out;
    while (std::ssize(out) < options_.pairs) {
      const auto pixel = static_cast<std::size_t>(random.integer(frame.width * frame.height));
      const std::int32_t triangle = frame.triangle[pixel];
      if (triangle < 0 || triangle >= mesh_->triangle_count()) continue;
      const Eigen::Vector3d point = mesh_->positions_m.row(mesh_->triangles(triangle, 0));
      const Eigen::Vector2d noise(random.normal(), random.normal());
      out.push_back({std::string("p").append(std::to_string(out.size())), point,
                     project(camera, pose * point) + options_.click_px * noise});
    }
    return out;
  }

  std::shared_ptr<const Mesh> mesh_;
  std::shared_ptr<const Image> texture_, wall_texture_;
  ObjectSceneOptions options_;
};

/// A camera at the origin of its frame.
inline Camera test_camera(double focal_px, int width = 640, int height = 480) {
  Camera camera = Camera::centred(width, height, focal_px);
  camera.camera_from_world = {};
  return camera;
}

/// A random turn, such that an object of `size_m` fills about `fill` of the picture's height.
inline Rigid3 random_pose(const Camera& camera, double size_m, double fill, Random& random) {
  Eigen::Quaterniond turn(random.normal(), random.normal(), random.normal(), random.normal());
  const double depth_m = camera.focal_px.x() * size_m / (fill * camera.height);
  const double x = 0.1 * random.uniform(-1.0, 1.0) * size_m,
               y = 0.1 * random.uniform(-1.0, 1.0) * size_m;
  return {turn.normalized(), {x, y, depth_m}};
}

/// How far an estimate is from the truth, and how far in deviations.
struct ObjectErrors {
  double turn_deg = 0.0, place_mm = 0.0, focal_share = 0.0;
  std::vector<double> z;  // of each of the six figures of the pose, and of the focal length
};

inline ObjectErrors errors_of(const ObjectEstimate& estimate, std::size_t picture,
                              const Rigid3& truth, const Camera& camera) {
  const ObjectPose& pose = estimate.poses[picture];
  const Eigen::Vector3d turn = rotation_vector_from_quaternion(pose.camera_from_object.rotation *
                                                               truth.rotation.conjugate());
  const Eigen::Vector3d shift = pose.camera_from_object.translation_m - truth.translation_m;
  ObjectErrors out;
  out.turn_deg = turn.norm() * 180.0 / std::numbers::pi;
  out.place_mm = 1e3 * shift.norm();
  out.focal_share = estimate.camera.focal_px.x() / camera.focal_px.x() - 1.0;
  for (int k = 0; k < 3; ++k) out.z.push_back(turn[k] / std::sqrt(pose.covariance(k, k)));
  for (int k = 0; k < 3; ++k) {
    out.z.push_back(shift[k] / std::sqrt(pose.covariance(3 + k, 3 + k)));
  }
  if (estimate.focal_free) {
    out.z.push_back((estimate.camera.focal_px.x() - camera.focal_px.x()) /
                    estimate.intrinsics_sigma[0]);
  }
  return out;
}

}  // namespace semblance::testing
