#include "semblance/render/embree_renderer.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "frame.h"
#include "renderers.h"
#include "scene_check.h"
#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"

namespace semblance {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr float near_m = 1e-3f;

/// Numbers in [0, 1) from a counter (splitmix64 of Steele, Lea and Flood 2014): a stream per pixel
/// costs nothing to start.
class PixelRandom {
 public:
  PixelRandom(std::uint64_t seed, std::uint64_t pixel)
      : state_(seed * 0x9e3779b97f4a7c15u ^ (pixel + 1) * 0xd1342543de82ef95u) {}
  double uniform() {
    std::uint64_t z = state_ += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return static_cast<double>((z ^ z >> 31) >> 11) * 0x1p-53;
  }

 private:
  std::uint64_t state_;
};

struct Hit {
  int triangle = -1;
  float b1 = 0, b2 = 0, depth_m = 0;
  Vector3f face_normal = Vector3f::Zero();
};

/// A scene as Embree holds it, for one camera: triangles that reach behind its near plane are
/// absent.
class EmbreeScene {
 public:
  EmbreeScene(const Scene& scene, const Camera& camera);
  ~EmbreeScene();
  EmbreeScene(const EmbreeScene&) = delete;
  EmbreeScene& operator=(const EmbreeScene&) = delete;

  /// First surface along origin + t * direction for t >= near; depth_m is t.
  Hit first_hit(const Vector3f& origin, const Vector3f& direction) const;
  /// The same for many directions from one origin, which Embree follows side by side.
  std::vector<Hit> first_hits(const Vector3f& origin,
                              const std::vector<Vector3f>& directions) const;
  bool blocked(const Vector3f& origin, const Vector3f& direction, float distance) const;

 private:
  void add_triangles(const Scene& scene, const Camera& camera, RTCGeometry geometry);

  RTCDevice device_;
  RTCScene scene_;
};

EmbreeScene::EmbreeScene(const Scene& scene, const Camera& camera)
    : device_(rtcNewDevice(nullptr)) {
  if (device_ == nullptr) throw SolverError("Embree gives no device on this machine");
  scene_ = rtcNewScene(device_);
  rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);  // rays do not slip between triangles
  rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_LOW);
  const RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
  add_triangles(scene, camera, geometry);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene_, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene_);
  const RTCError error = rtcGetDeviceError(device_);
  if (error != RTC_ERROR_NONE)
    throw SolverError("Embree could not build the scene (error " + std::to_string(error) + ")");
}

EmbreeScene::~EmbreeScene() {
  rtcReleaseScene(scene_);
  rtcReleaseDevice(device_);
}

void EmbreeScene::add_triangles(const Scene& scene, const Camera& camera, RTCGeometry geometry) {
  std::size_t vertex_count = 0, triangle_count = 0;
  for (const SceneObject& object : scene.objects) {
    vertex_count += object.positions_m.rows();
    triangle_count += object.mesh->triangle_count();
  }
  if (triangle_count == 0) return;
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), vertex_count));
  auto* corners = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), triangle_count));
  if (vertices == nullptr || corners == nullptr)
    throw SolverError("Embree has no memory for the scene");
  const Eigen::RowVector3d axis = camera.camera_from_world.rotation.toRotationMatrix().row(2);
  unsigned first_vertex = 0;
  for (const SceneObject& object : scene.objects) {
    const PointsF& positions = object.positions_m;
    std::copy_n(positions.data(), positions.size(), vertices);
    vertices += positions.size();
    const Eigen::VectorXd depth = (positions.cast<double>() * axis.transpose()).array() +
                                  camera.camera_from_world.translation_m.z();
    for (Eigen::Index t = 0; t < object.mesh->triangle_count(); ++t, corners += 3) {
      const auto triangle = object.mesh->triangles.row(t);
      const bool in_front =
          depth[triangle[0]] > near_m && depth[triangle[1]] > near_m && depth[triangle[2]] > near_m;
      for (int c = 0; c < 3; ++c)
        corners[c] = first_vertex + (in_front ? triangle[c] : triangle[0]);  // else without area
    }
    first_vertex += static_cast<unsigned>(positions.rows());
  }
}

RTCRayHit make_ray(const Vector3f& origin, const Vector3f& direction) {
  RTCRayHit ray{};
  ray.ray = {origin.x(),
             origin.y(),
             origin.z(),
             near_m,
             direction.x(),
             direction.y(),
             direction.z(),
             0.0f,
             std::numeric_limits<float>::infinity(),
             ~0u,
             0,
             0};
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  return ray;
}

Hit hit_of(const RTCRayHit& ray) {
  if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
  return {static_cast<int>(ray.hit.primID), ray.hit.u, ray.hit.v, ray.ray.tfar,
          Vector3f(ray.hit.Ng_x, ray.hit.Ng_y, ray.hit.Ng_z).normalized()};
}

Hit EmbreeScene::first_hit(const Vector3f& origin, const Vector3f& direction) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit ray = make_ray(origin, direction);
  rtcIntersect1(scene_, &context, &ray);
  return hit_of(ray);
}

std::vector<Hit> EmbreeScene::first_hits(const Vector3f& origin,
                                         const std::vector<Vector3f>& directions) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  std::vector<RTCRayHit> rays;
  rays.reserve(directions.size());
  for (const Vector3f& direction : directions) rays.push_back(make_ray(origin, direction));
  rtcIntersect1M(scene_, &context, rays.data(), static_cast<unsigned>(rays.size()),
                 sizeof(RTCRayHit));
  std::vector<Hit> hits;
  hits.reserve(rays.size());
  for (const RTCRayHit& ray : rays) hits.push_back(hit_of(ray));
  return hits;
}

bool EmbreeScene::blocked(const Vector3f& origin, const Vector3f& direction, float distance) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay ray{
      origin.x(), origin.y(), origin.z(), 0.0f, direction.x(), direction.y(), direction.z(), 0.0f,
      distance,   ~0u,        0,          0};
  rtcOccluded1(scene_, &context, &ray);
  return ray.tfar < 0.0f;  // Embree's mark of an occluded ray
}

/// Direction about unit `normal` with density cos / pi.
Vector3f cosine_direction(const Vector3f& normal, PixelRandom& random) {
  const double height = 2.0 * random.uniform() - 1.0, angle = 2.0 * M_PI * random.uniform();
  const double radius = std::sqrt(std::max(0.0, 1.0 - height * height));
  const Vector3f on_sphere(static_cast<float>(radius * std::cos(angle)),
                           static_cast<float>(radius * std::sin(angle)),
                           static_cast<float>(height));
  const Vector3f sum = normal + on_sphere;
  return sum.squaredNorm() > 1e-12f ? Vector3f(sum.normalized()) : normal;
}

class Tracer {
 public:
  Tracer(const Scene& scene, const Camera& camera, const RayTraceOptions& options);

  void row(int y, Frame& frame) const;

 private:
  struct Surface {
    const SceneObject* object;
    Eigen::RowVector3i corners;
    Vector3f b;
  };

  Vector3f direction(double x_px, double y_px) const;
  Surface surface(const Hit& hit) const;
  Vector3f normal(const Surface& surface) const;
  Vector3f albedo(const Surface& surface) const;
  Vector3f colour(const Vector3f& ray, const Hit& hit, PixelRandom& random) const;
  Vector3f mean_colour(int x, int y, const Hit& centre) const;

  const Scene& scene_;
  const Camera& camera_;
  const RayTraceOptions& options_;
  EmbreeScene embree_;
  Eigen::Matrix3d world_from_camera_;
  Vector3f origin_;
  std::vector<int> first_triangles_;
};

Tracer::Tracer(const Scene& scene, const Camera& camera, const RayTraceOptions& options)
    : scene_(scene), camera_(camera), options_(options), embree_(scene, camera) {
  const Rigid3 world_from_camera = camera.camera_from_world.inverse();
  world_from_camera_ = world_from_camera.rotation.toRotationMatrix();
  origin_ = world_from_camera.translation_m.cast<float>();
  int first = 0;
  for (const SceneObject& object : scene.objects) {
    first_triangles_.push_back(first);
    first += static_cast<int>(object.mesh->triangle_count());
  }
}

/// Of length 1 / cos, so that the parameter along the ray is depth.
Vector3f Tracer::direction(double x_px, double y_px) const {
  return (world_from_camera_ * unproject(camera_, {x_px, y_px})).cast<float>();
}

Tracer::Surface Tracer::surface(const Hit& hit) const {
  const auto after =
      std::upper_bound(first_triangles_.begin(), first_triangles_.end(), hit.triangle);
  const std::size_t number = after - first_triangles_.begin() - 1;
  const SceneObject& object = scene_.objects[number];
  return {&object,
          object.mesh->triangles.row(hit.triangle - first_triangles_[number]),
          {1.0f - hit.b1 - hit.b2, hit.b1, hit.b2}};
}

Vector3f Tracer::normal(const Surface& surface) const {
  Vector3f sum = Vector3f::Zero();
  for (int c = 0; c < 3; ++c)
    sum += surface.b[c] * surface.object->normals.row(surface.corners[c]).transpose();
  return sum.norm() > 1e-30f ? Vector3f(sum.normalized()) : Vector3f(Vector3f::Zero());
}

Vector3f Tracer::albedo(const Surface& surface) const {
  const Material& material = surface.object->material;
  if (material.texture == nullptr) return material.colour;
  Eigen::Vector2f uv = Eigen::Vector2f::Zero();
  for (int c = 0; c < 3; ++c)
    uv += surface.b[c] * surface.object->mesh->uvs.row(surface.corners[c]).transpose();
  Vector3f texel;
  sample_bilinear(*material.texture, uv.x() * static_cast<float>(material.texture->width),
                  (1.0f - uv.y()) * static_cast<float>(material.texture->height), texel.data());
  return texel;
}

Vector3f Tracer::colour(const Vector3f& ray, const Hit& hit, PixelRandom& random) const {
  if (hit.triangle < 0) return scene_.background;
  const Surface seen = surface(hit);
  const Vector3f n = normal(seen);
  const auto basis = sh_basis(n.x(), n.y(), n.z());
  Vector3f light = Vector3f::Zero();
  for (int k = 0; k < 9; ++k) light += basis[k] * scene_.light.coefficients[k];

  const Vector3f outwards = hit.face_normal.dot(ray) < 0.0f ? hit.face_normal : -hit.face_normal;
  // Off the surface by more than the rounding of the point on it.
  const Vector3f point = origin_ + hit.depth_m * ray + 2e-5f * (1.0f + hit.depth_m) * outwards;
  if (options_.occlusion_rays > 0) {
    int open = 0;
    for (int i = 0; i < options_.occlusion_rays; ++i)
      open += !embree_.blocked(point, cosine_direction(outwards, random),
                               static_cast<float>(options_.occlusion_distance_m));
    light *= static_cast<float>(open) / static_cast<float>(options_.occlusion_rays);
  }
  if (options_.lamp) {
    const Vector3f l = options_.lamp->towards_light.normalized().cast<float>();
    const float cosine = n.dot(l);
    const bool lit =
        cosine > 0.0f && !(options_.lamp->shadows &&
                           embree_.blocked(point, l, std::numeric_limits<float>::infinity()));
    if (lit) light += cosine * options_.lamp->radiance;
  }
  return albedo(seen).cwiseProduct(light);
}

Vector3f Tracer::mean_colour(int x, int y, const Hit& centre) const {
  PixelRandom random(options_.seed, static_cast<std::uint64_t>(y) * camera_.width + x);
  const int count = options_.samples_per_pixel;
  if (count == 1) return colour(direction(x + 0.5, y + 0.5), centre, random);
  // The R2 sequence (Roberts 2018) from a random start: evenly spread for any count.
  const double start_x = random.uniform(), start_y = random.uniform();
  Vector3f sum = Vector3f::Zero();
  for (int i = 0; i < count; ++i) {
    const double dx = std::fmod(start_x + i * 0.7548776662466927, 1.0);
    const double dy = std::fmod(start_y + i * 0.5698402909980532, 1.0);
    const Vector3f ray = direction(x + dx, y + dy);
    sum += colour(ray, embree_.first_hit(origin_, ray), random);
  }
  return sum / static_cast<float>(count);
}

void Tracer::row(int y, Frame& frame) const {
  // Directions through a pinhole's pixels change evenly along a row.
  const Vector3d first = world_from_camera_ * unproject(camera_, {0.5, y + 0.5});
  const Vector3d step = world_from_camera_.col(0) / camera_.focal_px.x();
  std::vector<Vector3f> centres;
  centres.reserve(static_cast<std::size_t>(camera_.width));
  for (int x = 0; x < camera_.width; ++x) centres.push_back((first + x * step).cast<float>());
  const std::vector<Hit> hits = embree_.first_hits(origin_, centres);
  for (int x = 0; x < camera_.width; ++x) {
    const std::size_t at = static_cast<std::size_t>(y) * camera_.width + x;
    const Hit& hit = hits[x];
    if (hit.triangle < 0 && options_.samples_per_pixel == 1) continue;  // shows the background
    if (!frame.colour.empty())
      Eigen::Map<Vector3f>(frame.colour.pixel(x, y)) = mean_colour(x, y, hit);
    if (hit.triangle < 0) continue;
    if (!frame.depth.empty()) frame.depth.data[at] = hit.depth_m;
    if (!frame.triangle.empty()) frame.triangle[at] = hit.triangle;
    if (!frame.mask.empty()) frame.mask[at] = 1;
    if (!frame.barycentric.empty())
      Eigen::Map<Vector3f>(frame.barycentric.pixel(x, y)) = surface(hit).b;
    if (!frame.normal.empty())
      Eigen::Map<Vector3f>(frame.normal.pixel(x, y)) = normal(surface(hit));
  }
}

void check_options(const RayTraceOptions& options) {
  if (options.samples_per_pixel < 1 || options.samples_per_pixel > 65536)
    throw InvalidInput("samples_per_pixel is " + std::to_string(options.samples_per_pixel) +
                       ": expected 1 to 65536");
  if (options.occlusion_rays < 0 || options.occlusion_rays > 65536)
    throw InvalidInput("occlusion_rays is " + std::to_string(options.occlusion_rays) +
                       ": expected 0 to 65536");
  if (!(options.occlusion_distance_m > 0.0))
    throw InvalidInput("occlusion_distance_m must be positive");
  if (options.lamp && !(options.lamp->towards_light.norm() > 0.0))
    throw InvalidInput("the lamp's direction must not be zero");
}

class EmbreeRenderer : public Renderer {
 public:
  std::string name() const override { return "embree"; }
  std::unique_ptr<Renderer> clone() const override { return std::make_unique<EmbreeRenderer>(); }
  Frame render(const Scene& scene, const Camera& camera, Channel channels) override {
    return ray_trace(scene, camera, channels);
  }
};

}  // namespace

Frame ray_trace(const Scene& scene, const Camera& camera, Channel channels,
                const RayTraceOptions& options) {
  check_renderable(scene, camera);
  check_shadable(scene, channels);
  check_options(options);
  Frame frame = empty_frame(scene, camera, channels);
  const Tracer tracer(scene, camera, options);
  parallel_for(camera.height, [&](std::size_t y) { tracer.row(static_cast<int>(y), frame); });
  return frame;
}

std::unique_ptr<Renderer> make_embree_renderer() { return std::make_unique<EmbreeRenderer>(); }

}  // namespace semblance
