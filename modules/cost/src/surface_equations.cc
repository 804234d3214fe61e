#include "semblance/cost/surface_equations.h"

#include <algorithm>
#include <string>
#include <unordered_map>

#include "semblance/core/errors.h"
#include "surface_kernel.h"

namespace semblance {

SurfaceTopology::SurfaceTopology(const Triangles& faces) {
  std::unordered_map<std::uint64_t, int> edge_index;
  edge_index.reserve(static_cast<std::size_t>(faces.rows()) * 2);
  std::vector<std::array<int, 2>> ends;
  for (Eigen::Index t = 0; t < faces.rows(); ++t) {
    const std::array<int, 3> corner = {faces(t, 0), faces(t, 1), faces(t, 2)};
    std::array<int, 3> edge{};
    for (int i = 0; i < 3; ++i) {
      const auto [low, high] = std::minmax(corner[(i + 1) % 3], corner[(i + 2) % 3]);
      const std::uint64_t key =
          (static_cast<std::uint64_t>(low) << 32) | static_cast<unsigned>(high);
      const auto [found, is_new] = edge_index.try_emplace(key, static_cast<int>(ends.size()));
      if (is_new) ends.push_back({low, high});
      edge[i] = found->second;
    }
    triangles.push_back(corner);
    triangle_edges.push_back(edge);
    vertex_count = std::max({vertex_count, corner[0] + 1, corner[1] + 1, corner[2] + 1});
  }
  edge_count = static_cast<int>(ends.size());
  first_spoke.assign(static_cast<std::size_t>(vertex_count) + 1, 0);
  for (const auto& [low, high] : ends) ++first_spoke[low + 1], ++first_spoke[high + 1];
  for (int v = 0; v < vertex_count; ++v) first_spoke[v + 1] += first_spoke[v];
  spokes.resize(2 * ends.size());
  std::vector<int> next(first_spoke.begin(), first_spoke.end() - 1);
  for (int e = 0; e < edge_count; ++e) {
    const auto [low, high] = ends[e];
    spokes[next[low]++] = {e, high};
    spokes[next[high]++] = {e, low};
  }
}

SurfaceEquations::SurfaceEquations(const SurfaceTopology* topology)
    : topology_(topology),
      accumulators_(topology->triangles.size()),
      slot_of_triangle_(topology->triangles.size(), -1),
      touched_triangles_(topology->triangles.size() + 1),
      slot_of_vertex_(static_cast<std::size_t>(topology->vertex_count), -1) {}

void SurfaceEquations::reset() {
  for (const std::int32_t t : touched_triangles()) slot_of_triangle_[t] = -1;
  touched_count_ = 0;
  vertices_current_ = false;
}

void SurfaceEquations::add(int triangle, float b0, float b1, float b2, float m_xx, float m_xy,
                           float m_yy, float v_x, float v_y) {
  const std::int32_t touched[] = {triangle};
  float* a = accumulators(touched).of(triangle);
  const float b[3] = {b0, b1, b2};
  const float m[3] = {m_xx, m_xy, m_yy};
  for (int k = 0; k < 3; ++k, a += 8) {
    for (int j = 0; j < 3; ++j) {
      a[j] += b[k] * b[k] * m[j];
      a[4 + j] += b[(k + 1) % 3] * b[(k + 2) % 3] * m[j];
    }
    a[3] += b[k] * v_x;
    a[7] += b[k] * v_y;
  }
}

SurfaceAccumulators SurfaceEquations::accumulators(std::span<const std::int32_t> triangles) {
  vertices_current_ = false;
  // Without a branch, since whether a point's triangle is new cannot be predicted.
  auto count = static_cast<std::int32_t>(touched_count_);
  for (const std::int32_t t : triangles) {
    touched_triangles_[count] = t;
    const std::int32_t slot = slot_of_triangle_[t];
    slot_of_triangle_[t] = slot < 0 ? count : slot;
    count += slot < 0 ? 1 : 0;
  }
  std::fill(accumulators_.begin() + static_cast<std::ptrdiff_t>(touched_count_),
            accumulators_.begin() + count, Sums{});
  touched_count_ = count;
  return {accumulators_.data()->values, slot_of_triangle_.data()};
}

const std::vector<int>& SurfaceEquations::touched_vertices() {
  if (vertices_current_) return touched_vertices_;
  std::fill(slot_of_vertex_.begin(), slot_of_vertex_.end(), -1);
  const Sums* sums = accumulators_.data();
  for (const std::int32_t t : touched_triangles()) {
    const float* a = (sums++)->values;
    // The trace of the corners' own blocks: zero only where nothing, or nothing with a gradient,
    // was added.
    if (a[0] + a[2] + a[8] + a[10] + a[16] + a[18] <= 0.0f) continue;
    for (int vertex : topology_->triangles[t]) slot_of_vertex_[vertex] = 0;
  }
  touched_vertices_.clear();
  for (int v = 0; v < topology_->vertex_count; ++v) {
    if (slot_of_vertex_[v] < 0) continue;
    slot_of_vertex_[v] = static_cast<int>(touched_vertices_.size());
    touched_vertices_.push_back(v);
  }
  vertices_current_ = true;
  return touched_vertices_;
}

namespace {
using Four = Eigen::Map<Eigen::Array4f>;
using FourOf = Eigen::Map<const Eigen::Array4f>;
}  // namespace

/// Sums of the triangles' accumulators per vertex and edge.
void SurfaceEquations::gather_blocks() {
  own_.assign(4 * touched_vertices_.size(), 0.0f);
  pull_y_.assign(touched_vertices_.size(), 0.0f);
  edge_blocks_.assign(std::size_t{4} * topology_->edge_count, 0.0f);
  const Sums* sums = accumulators_.data();
  for (const std::int32_t t : touched_triangles()) {
    const float* a = (sums++)->values;
    for (int k = 0; k < 3; ++k, a += 8) {
      const int slot = slot_of_vertex_[topology_->triangles[t][k]];
      if (slot < 0) continue;
      const std::ptrdiff_t edge = topology_->triangle_edges[t][k];
      Four(own_.data() + std::ptrdiff_t{4} * slot) += FourOf(a);
      Four(edge_blocks_.data() + 4 * edge) += FourOf(a + 4);
      pull_y_[slot] += a[7];
    }
  }
}

void SurfaceEquations::assemble(const Motion& motion, NormalEquations& out) {
  const Eigen::Index rows = 2 * static_cast<Eigen::Index>(touched_vertices().size());
  if (motion.rows() != rows || motion.cols() != padded_columns(out.gradient.size())) {
    throw InvalidInput("the motion of a surface has " + std::to_string(motion.rows()) + " x " +
                       std::to_string(motion.cols()) + " entries: expected " +
                       std::to_string(rows) + " x " +
                       std::to_string(padded_columns(out.gradient.size())));
  }
  gather_blocks();
  const auto stride = static_cast<std::size_t>(motion.cols());
  scratch_.resize(detail::surface_scratch_rows * stride);
  hessian_.assign(stride * stride, 0.0f);
  gradient_.assign(stride, 0.0f);
  const detail::SurfaceSums sums{touched_vertices_.size(),
                                 stride,
                                 motion.data(),
                                 touched_vertices_.data(),
                                 slot_of_vertex_.data(),
                                 topology_->spokes.data(),
                                 topology_->first_spoke.data(),
                                 own_.data(),
                                 pull_y_.data(),
                                 edge_blocks_.data()};
  detail::surface_kernel()(sums, scratch_.data(), hessian_.data(), gradient_.data());
  const Eigen::Index size = out.gradient.size();
  for (Eigen::Index r = 0; r < size; ++r) {
    out.gradient[r] += gradient_[r];
    out.hessian(r, r) += hessian_[r * stride + r];
    for (Eigen::Index c = 0; c < r; ++c) {
      out.hessian(r, c) += hessian_[r * stride + c];
      out.hessian(c, r) += hessian_[r * stride + c];
    }
  }
}

}  // namespace semblance
