#include "tracer.h"

#include <embree3/rtcore.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Vector3f;

constexpr int kLanes = 8;
constexpr float kShadowBias = 1e-4f;  // metres above the surface where shadow rays start

struct Hit {
  const SceneObject* object;
  const Surface* surface;
  Eigen::Vector3i corners;
  float b0, b1, b2;
};

Vector3f blend(const PointsF& rows, const Hit& hit) {
  return hit.b0 * rows.row(hit.corners[0]) + hit.b1 * rows.row(hit.corners[1]) +
         hit.b2 * rows.row(hit.corners[2]);
}

Vector3f albedo_at(const Hit& hit) {
  const Material& material = hit.object->material;
  if (!material.texture) return material.colour;
  const auto& uvs = hit.object->mesh->uvs;
  const Eigen::Vector2f uv = hit.b0 * uvs.row(hit.corners[0]) + hit.b1 * uvs.row(hit.corners[1]) +
                             hit.b2 * uvs.row(hit.corners[2]);
  const Image& texture = *material.texture;
  Vector3f colour;
  sample_bilinear(texture, uv.x() * static_cast<float>(texture.width),
                  (1 - uv.y()) * static_cast<float>(texture.height), colour.data());
  return colour;
}

Vector3f sky_light(const ShLight& sky, const Vector3f& normal) {
  const auto basis = sh_basis(normal.x(), normal.y(), normal.z());
  Vector3f sum = Vector3f::Zero();
  for (int k = 0; k < 9; ++k) sum += basis[k] * sky.coefficients[k];
  return sum.cwiseMax(0.0f);
}

struct PixelBox {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

}  // namespace

struct Tracer::Impl {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  const Scene* source = nullptr;
  const std::vector<Surface>* surfaces = nullptr;

  void release_scene() {
    if (scene != nullptr) rtcReleaseScene(scene);
    scene = nullptr;
  }
  /// The pixels that the scene's vertices can touch; all of them if one lies near the camera's
  /// plane.
  PixelBox extent(const Camera& camera) const;
  bool blocked(const Vector3f& from, const Vector3f& direction, float reach) const;
  Vector3f shade(const Hit& hit, const Vector3f& to_eye, const Vector3f& place,
                 const Lighting& lighting) const;
};

Tracer::Tracer() : impl_(std::make_unique<Impl>()) {
  impl_->device = rtcNewDevice("threads=1");
  if (impl_->device == nullptr) throw SolverError("Embree cannot be started");
}

Tracer::~Tracer() {
  if (!impl_) return;
  impl_->release_scene();
  rtcReleaseDevice(impl_->device);
}

Tracer::Tracer(Tracer&&) noexcept = default;

void Tracer::set_scene(const Scene& scene, const std::vector<Surface>& surfaces) {
  impl_->release_scene();
  impl_->source = &scene;
  impl_->surfaces = &surfaces;
  impl_->scene = rtcNewScene(impl_->device);
  rtcSetSceneFlags(impl_->scene, RTC_SCENE_FLAG_ROBUST);
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    const SceneObject& object = scene.objects[i];
    RTCGeometry geometry = rtcNewGeometry(impl_->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                3 * sizeof(float), object.positions_m.rows()));
    std::copy_n(object.positions_m.data(), object.positions_m.size(), vertices);
    auto* indices = static_cast<unsigned*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                3 * sizeof(unsigned), object.mesh->triangles.rows()));
    std::copy_n(object.mesh->triangles.data(), object.mesh->triangles.size(), indices);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(impl_->scene, geometry, static_cast<unsigned>(i));
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(impl_->scene);
  if (rtcGetDeviceError(impl_->device) != RTC_ERROR_NONE)
    throw SolverError("Embree could not build the scene");
}

PixelBox Tracer::Impl::extent(const Camera& camera) const {
  const PixelBox whole{0, 0, camera.width, camera.height};
  Eigen::AlignedBox2d bounds;
  for (const SceneObject& object : source->objects)
    for (Eigen::Index i = 0; i < object.positions_m.rows(); ++i) {
      const Eigen::Vector3d place =
          camera.camera_from_world * object.positions_m.row(i).transpose().cast<double>().eval();
      if (place.z() < 0.01) return whole;
      bounds.extend(project(camera, place));
    }
  if (bounds.isEmpty()) return {};
  const auto clamped = [](double value, int size) {
    return static_cast<int>(std::clamp(value, 0.0, static_cast<double>(size)));
  };
  return {clamped(bounds.min().x() - 1, whole.x1), clamped(bounds.min().y() - 1, whole.y1),
          clamped(bounds.max().x() + 2, whole.x1), clamped(bounds.max().y() + 2, whole.y1)};
}

bool Tracer::Impl::blocked(const Vector3f& from, const Vector3f& direction, float reach) const {
  RTCRay ray{};
  ray.org_x = from.x(), ray.org_y = from.y(), ray.org_z = from.z();
  ray.dir_x = direction.x(), ray.dir_y = direction.y(), ray.dir_z = direction.z();
  ray.tnear = 0, ray.tfar = reach;
  ray.mask = ~0u;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(scene, &context, &ray);
  return ray.tfar < 0;
}

Vector3f Tracer::Impl::shade(const Hit& hit, const Vector3f& to_eye, const Vector3f& place,
                             const Lighting& lighting) const {
  const Vector3f albedo = albedo_at(hit);
  Vector3f normal = blend(hit.object->normals, hit).normalized();
  if (normal.dot(to_eye) < 0 && normal.dot(to_eye) < -0.3f) normal = -normal;
  float open = 1.0f;
  if (!hit.surface->ambient.empty())
    open = hit.b0 * hit.surface->ambient[hit.corners[0]] +
           hit.b1 * hit.surface->ambient[hit.corners[1]] +
           hit.b2 * hit.surface->ambient[hit.corners[2]];
  Vector3f light = open * sky_light(lighting.sky, normal);
  const float cosine = normal.dot(lighting.lamp_direction);
  const float wrap = hit.surface->wrap;
  float highlight = 0.0f;
  if (cosine > -wrap && lighting.lamp_colour.maxCoeff() > 0 &&
      !blocked(place + kShadowBias * normal + kShadowBias * to_eye, lighting.lamp_direction,
               10.0f)) {
    light += lighting.lamp_colour * std::max(0.0f, (cosine + wrap) / (1 + wrap));
    const Vector3f half = (to_eye + lighting.lamp_direction).normalized();
    highlight =
        hit.surface->gloss * std::pow(std::max(0.0f, normal.dot(half)), hit.surface->shininess);
  }
  return albedo.cwiseProduct(light) + highlight * lighting.lamp_colour;
}

Traced Tracer::trace(const Camera& camera, const Lighting& lighting, int samples) const {
  const int side = static_cast<int>(std::lround(std::sqrt(samples)));
  const Rigid3 world_from_camera = camera.camera_from_world.inverse();
  const Eigen::Matrix3f turn = world_from_camera.rotation.toRotationMatrix().cast<float>();
  const Vector3f eye = world_from_camera.translation_m.cast<float>();
  Traced out{Image(camera.width, camera.height, 4), Image(camera.width, camera.height, 1)};
  const PixelBox box = impl_->extent(camera);
  const float weight = 1.0f / static_cast<float>(samples);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  for (int row = box.y0 * side; row < box.y1 * side; ++row) {
    const float y = (static_cast<float>(row) + 0.5f) / static_cast<float>(side);
    const float direction_y =
        (y - static_cast<float>(camera.principal_px.y())) / static_cast<float>(camera.focal_px.y());
    for (int first = box.x0 * side; first < box.x1 * side; first += kLanes) {
      alignas(32) RTCRayHit8 rays{};
      alignas(32) int valid[kLanes];
      for (int k = 0; k < kLanes; ++k) {
        valid[k] = first + k < box.x1 * side ? -1 : 0;
        const float x = (static_cast<float>(first + k) + 0.5f) / static_cast<float>(side);
        const Vector3f direction =
            turn * Vector3f((x - static_cast<float>(camera.principal_px.x())) /
                                static_cast<float>(camera.focal_px.x()),
                            direction_y, 1.0f);
        rays.ray.org_x[k] = eye.x(), rays.ray.org_y[k] = eye.y(), rays.ray.org_z[k] = eye.z();
        rays.ray.dir_x[k] = direction.x(), rays.ray.dir_y[k] = direction.y();
        rays.ray.dir_z[k] = direction.z();
        rays.ray.tnear[k] = 1e-3f, rays.ray.tfar[k] = std::numeric_limits<float>::infinity();
        rays.ray.mask[k] = ~0u;
        rays.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
      }
      rtcIntersect8(valid, impl_->scene, &context, &rays);
      for (int k = 0; k < kLanes; ++k) {
        if (valid[k] == 0 || rays.hit.geomID[k] == RTC_INVALID_GEOMETRY_ID) continue;
        const SceneObject& object = impl_->source->objects[rays.hit.geomID[k]];
        const float u = rays.hit.u[k], v = rays.hit.v[k];
        const Hit hit{&object,
                      &(*impl_->surfaces)[rays.hit.geomID[k]],
                      object.mesh->triangles.row(rays.hit.primID[k]),
                      1 - u - v,
                      u,
                      v};
        const Vector3f direction(rays.ray.dir_x[k], rays.ray.dir_y[k], rays.ray.dir_z[k]);
        // The ray's direction has z = 1 in the camera's frame, so its length parameter is depth.
        const float depth = rays.ray.tfar[k];
        const Vector3f colour =
            impl_->shade(hit, -direction.normalized(), eye + depth * direction, lighting);
        float* pixel = out.rgba.pixel((first + k) / side, row / side);
        for (int c = 0; c < 3; ++c) pixel[c] += weight * colour[c];
        pixel[3] += weight;
        float& nearest = *out.depth.pixel((first + k) / side, row / side);
        if (nearest == 0 || depth < nearest) nearest = depth;
      }
    }
  }
  return out;
}

std::vector<float> Tracer::ambient_occlusion(int object_index, int rays, float reach_m) const {
  const SceneObject& object = impl_->source->objects[object_index];
  std::vector<float> open(object.positions_m.rows(), 1.0f);
  const float golden = std::numbers::pi_v<float> * (3 - std::sqrt(5.0f));
  for (Eigen::Index i = 0; i < object.positions_m.rows(); ++i) {
    const Vector3f normal = object.normals.row(i);
    if (normal.squaredNorm() < 0.5f) continue;
    const Vector3f tangent = normal.unitOrthogonal(), other = normal.cross(tangent);
    const Vector3f from = object.positions_m.row(i).transpose() + 5 * kShadowBias * normal;
    int leaving = 0;
    for (int k = 0; k < rays; ++k) {
      // Vogel's spiral on the disc, lifted to the hemisphere, is cosine-weighted (Malley).
      const float radius = std::sqrt((static_cast<float>(k) + 0.5f) / static_cast<float>(rays));
      const float angle = golden * static_cast<float>(k);
      const Vector3f direction = radius * std::cos(angle) * tangent +
                                 radius * std::sin(angle) * other +
                                 std::sqrt(1 - radius * radius) * normal;
      leaving += impl_->blocked(from, direction, reach_m) ? 0 : 1;
    }
    open[i] = static_cast<float>(leaving) / static_cast<float>(rays);
  }
  return open;
}

}  // namespace semblance
