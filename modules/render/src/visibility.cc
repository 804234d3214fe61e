#include "semblance/render/visibility.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels.h"
#include "scene_check.h"

namespace semblance {
namespace {

/// An edge function of a triangle of any size, in 64 bits: vertices lie within 2^30 subpixels, so
/// products of differences stay below 2^62.
struct WideEdge {
  std::int64_t gx, gy, value;  // per subpixel; value at the first pixel of the row, bias included

  /// Narrows the columns [first, last] of a row to those inside this edge.
  void narrow(std::int64_t& first, std::int64_t& last) const {
    const std::int64_t step = gx * subpixel_one;
    if (step == 0) {
      if (value < 0) last = first - 1;
    } else if (step > 0) {  // column >= -value / step
      if (value < 0) first = std::max(first, (-value + step - 1) / step);
    } else {  // column <= value / -step
      last = std::min(last, value < 0 ? std::int64_t{-1} : value / -step);
    }
  }
};

WideEdge wide_edge(std::int64_t gx, std::int64_t gy, std::int64_t value) {
  const bool owns_its_pixels = gx > 0 || (gx == 0 && gy > 0);
  return {gx, gy, value - (owns_its_pixels ? 0 : 1)};
}

/// Draws one triangle row by row; the wide kernel leaves those it is not made for to this.
void draw_large(const RasteriseArgs& args, std::int32_t row) {
  const std::int32_t* corner = args.triangles + 3 * static_cast<std::int64_t>(row);
  const ScreenVertex &p = args.vertices[corner[0]], &q = args.vertices[corner[1]],
                     &r = args.vertices[corner[2]];
  const std::int64_t ax = std::int64_t{q.x} - p.x, ay = std::int64_t{q.y} - p.y;
  const std::int64_t bx = std::int64_t{r.x} - p.x, by = std::int64_t{r.y} - p.y;
  const std::int64_t area = ax * by - bx * ay;
  if (area == 0 || (args.front_only && area > 0)) return;
  const std::int64_t x0 = std::max<std::int64_t>(
      (std::min({p.x, q.x, r.x}) + subpixel_one - 1) >> subpixel_bits, args.x0);
  const std::int64_t y0 = std::max<std::int64_t>(
      (std::min({p.y, q.y, r.y}) + subpixel_one - 1) >> subpixel_bits, args.y0);
  const std::int64_t x1 =
      std::min<std::int64_t>(std::max({p.x, q.x, r.x}) >> subpixel_bits, args.x1 - 1);
  const std::int64_t y1 =
      std::min<std::int64_t>(std::max({p.y, q.y, r.y}) >> subpixel_bits, args.y1 - 1);

  const std::int64_t sign = area > 0 ? 1 : -1;
  const std::int64_t dx = x0 * subpixel_one - p.x, dy = y0 * subpixel_one - p.y;
  const std::int64_t gx1 = sign * by, gy1 = -sign * bx, gx2 = -sign * ay, gy2 = sign * ax;
  const std::int64_t e1 = gx1 * dx + gy1 * dy, e2 = gx2 * dx + gy2 * dy;
  WideEdge edges[3] = {wide_edge(-gx1 - gx2, -gy1 - gy2, sign * area - e1 - e2),
                       wide_edge(gx1, gy1, e1), wide_edge(gx2, gy2, e2)};

  const double per_area = static_cast<double>(subpixel_one) / static_cast<double>(area);
  const double az = double{q.inverse_z} - p.inverse_z, bz = double{r.inverse_z} - p.inverse_z;
  const double slope_x = (az * by - bz * ay) * per_area, slope_y = (bz * ax - az * bx) * per_area;
  const double w1 = q.inverse_z * per_area, w2 = r.inverse_z * per_area;
  args.planes[row] = {static_cast<float>(w1 * by),
                      static_cast<float>(-w1 * bx),
                      static_cast<float>(-w2 * ay),
                      static_cast<float>(w2 * ax),
                      static_cast<float>(p.x) / subpixel_one,
                      static_cast<float>(p.y) / subpixel_one,
                      {}};
  const float lowest = std::min({p.inverse_z, q.inverse_z, r.inverse_z});
  const float highest = std::max({p.inverse_z, q.inverse_z, r.inverse_z});
  const PixelKey complement = static_cast<std::uint32_t>(~(args.first_id + row));

  for (std::int64_t y = y0; y <= y1; ++y) {
    std::int64_t first = 0, last = x1 - x0;
    for (WideEdge& edge : edges) {
      edge.narrow(first, last);
      edge.value += edge.gy * subpixel_one;
    }
    PixelKey* keys = args.keys + (y - args.y0) * args.stride + (x0 - args.x0);
    const double row_z =
        p.inverse_z + slope_y * (static_cast<double>(y * subpixel_one - p.y) / subpixel_one);
    const double dx_px = static_cast<double>(dx) / subpixel_one;
    for (std::int64_t x = first; x <= last; ++x) {
      const float z = static_cast<float>(row_z + slope_x * (dx_px + static_cast<double>(x)));
      const float clamped = std::min(std::max(z, lowest), highest);
      std::uint32_t bits;
      __builtin_memcpy(&bits, &clamped, 4);
      keys[x] = std::max(keys[x], PixelKey{bits} << 32 | complement);
    }
  }
}

}  // namespace

struct Rasteriser::Impl {
  const Kernels* kernels;
  Faces faces;
  std::vector<ScreenVertex> vertices;
  std::vector<float> projected;
  std::size_t vertex_count = 0;
  std::vector<TrianglePlanes> planes;
  std::vector<std::int32_t> large;
  std::vector<PixelKey> keys;  // all zero between calls
  std::vector<std::int32_t> pending_triangle;
  std::vector<float> pending_inverse_z, pending_x, pending_y;

  /// Projects every vertex; returns the pixels of `limit` that they may cover.
  PixelRect project(const Scene& scene, const Camera& camera, const PixelRect& limit);
  void rasterise(const Scene& scene, const PixelRect& rect);
  void list_pixels(const PixelRect& rect, int image_width, VisiblePixels& out);
};

namespace {

/// Grows only, so that a steady scene costs no allocation and no clearing.
template <class T>
void reserve_entries(std::vector<T>& list, std::size_t count) {
  if (list.size() < count) list.resize(count);
}

/// Rows of the key buffer are padded to the kernels' width.
int key_stride(const PixelRect& rect) {
  return (rect.x1 - rect.x0 + most_lanes - 1) / most_lanes * most_lanes;
}

ProjectArgs project_args(const Camera& camera) {
  ProjectArgs args{};
  const Eigen::Matrix3d rotation = camera.camera_from_world.rotation.toRotationMatrix();
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) args.rotation[3 * i + k] = static_cast<float>(rotation(i, k));
    args.translation[i] = static_cast<float>(camera.camera_from_world.translation_m[i]);
  }
  args.focal_x = static_cast<float>(camera.focal_px.x());
  args.focal_y = static_cast<float>(camera.focal_px.y());
  args.principal_x = static_cast<float>(camera.principal_px.x());
  args.principal_y = static_cast<float>(camera.principal_px.y());
  args.min_x = args.min_y = std::numeric_limits<std::int32_t>::max();
  args.max_x = args.max_y = -std::numeric_limits<std::int32_t>::max();
  return args;
}

}  // namespace

PixelRect Rasteriser::Impl::project(const Scene& scene, const Camera& camera,
                                    const PixelRect& limit) {
  vertex_count = 0;
  for (const SceneObject& object : scene.objects) vertex_count += object.positions_m.rows();
  reserve_entries(vertices, vertex_count + most_lanes);
  reserve_entries(projected, 3 * (vertex_count + most_lanes) + 1);
  ProjectArgs args = project_args(camera);
  args.vertices = vertices.data();
  args.projected = projected.data();
  for (const SceneObject& object : scene.objects) {
    args.positions = object.positions_m.data();
    args.count = object.positions_m.rows();
    kernels->project(args);
    args.vertices += args.count;
    args.projected += 3 * args.count;
  }
  if (args.min_x > args.max_x) return {};
  return {std::max(limit.x0, (args.min_x + subpixel_one - 1) >> subpixel_bits),
          std::max(limit.y0, (args.min_y + subpixel_one - 1) >> subpixel_bits),
          std::min(limit.x1, (args.max_x >> subpixel_bits) + 1),
          std::min(limit.y1, (args.max_y >> subpixel_bits) + 1)};
}

void Rasteriser::Impl::rasterise(const Scene& scene, const PixelRect& rect) {
  std::size_t triangle_count = 0;
  for (const SceneObject& object : scene.objects) triangle_count += object.mesh->triangle_count();
  reserve_entries(planes, triangle_count + most_lanes);
  reserve_entries(large, triangle_count);
  reserve_entries(keys, static_cast<std::size_t>(key_stride(rect)) * (rect.y1 - rect.y0));
  RasteriseArgs args{};
  args.x0 = rect.x0, args.y0 = rect.y0, args.x1 = rect.x1, args.y1 = rect.y1;
  args.keys = keys.data();
  args.stride = key_stride(rect);
  args.large = large.data();
  args.vertices = vertices.data();
  args.front_only = faces == Faces::front;
  for (const SceneObject& object : scene.objects) {
    args.triangles = object.mesh->triangles.data();
    args.count = object.mesh->triangle_count();
    args.planes = planes.data() + args.first_id;
    kernels->rasterise(args);
    for (std::int64_t i = 0; i < args.large_count; ++i) draw_large(args, large[i]);
    args.first_id += static_cast<std::int32_t>(args.count);
    args.vertices += object.positions_m.rows();
  }
}

void Rasteriser::Impl::list_pixels(const PixelRect& rect, int image_width, VisiblePixels& out) {
  const int stride = key_stride(rect), height = rect.y1 - rect.y0;
  const std::size_t room = static_cast<std::size_t>(stride) + 2 * most_lanes;
  reserve_entries(pending_triangle, room);
  for (std::vector<float>* list : {&pending_inverse_z, &pending_x, &pending_y})
    reserve_entries(*list, room);
  const std::size_t count =
      kernels->count_seen(keys.data(), static_cast<std::int64_t>(stride) * height);
  for (std::vector<std::int32_t>* list : {&out.pixel, &out.triangle}) list->resize(count);
  for (std::vector<float>* list : {&out.b1, &out.b2, &out.depth_m}) list->resize(count);
  kernels->list({keys.data(), stride, height, rect.x0, rect.y0, image_width, planes.data(),
                 out.pixel.data(), out.triangle.data(), out.b1.data(), out.b2.data(),
                 out.depth_m.data(), pending_triangle.data(), pending_inverse_z.data(),
                 pending_x.data(), pending_y.data()});
}

Rasteriser::Rasteriser(Instructions instructions, Faces faces) : impl_(std::make_unique<Impl>()) {
  impl_->faces = faces;
  impl_->kernels = instructions == Instructions::portable ? &portable_kernels()
                   : instructions == Instructions::avx2   ? &avx2_kernels()
                                                          : &best_kernels();
}
Rasteriser::~Rasteriser() = default;
Rasteriser::Rasteriser(Rasteriser&&) noexcept = default;
Rasteriser& Rasteriser::operator=(Rasteriser&&) noexcept = default;

void Rasteriser::visible_pixels(const Scene& scene, const Camera& camera, const PixelRect* region,
                                VisiblePixels& out) {
  check_renderable(scene, camera);
  PixelRect limit{0, 0, camera.width, camera.height};
  if (region != nullptr)
    limit = {std::max(0, region->x0), std::max(0, region->y0), std::min(camera.width, region->x1),
             std::min(camera.height, region->y1)};
  const PixelRect rect = impl_->project(scene, camera, limit);
  if (rect.x0 >= rect.x1 || rect.y0 >= rect.y1) {
    out = {};
    return;
  }
  impl_->rasterise(scene, rect);
  impl_->list_pixels(rect, camera.width, out);
}

std::span<const float> Rasteriser::projected_vertices() const {
  return {impl_->projected.data(), 3 * impl_->vertex_count};
}

}  // namespace semblance
