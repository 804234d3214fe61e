#include "semblance/cost/surface_equations.h"

#include <algorithm>
#include <map>
#include <unordered_map>

namespace semblance {

SurfaceTopology::SurfaceTopology(const Triangles& faces) {
  std::unordered_map<std::uint64_t, int> edge_index;
  edge_index.reserve(static_cast<std::size_t>(faces.rows()) * 2);
  for (Eigen::Index t = 0; t < faces.rows(); ++t) {
    const std::array<int, 3> corner = {faces(t, 0), faces(t, 1), faces(t, 2)};
    std::array<int, 3> edge{};
    for (int i = 0; i < 3; ++i) {
      const auto [low, high] = std::minmax(corner[(i + 1) % 3], corner[(i + 2) % 3]);
      const std::uint64_t key =
          (static_cast<std::uint64_t>(low) << 32) | static_cast<unsigned>(high);
      const auto [found, is_new] = edge_index.try_emplace(key, static_cast<int>(edges.size()));
      if (is_new) edges.push_back({low, high});
      edge[i] = found->second;
    }
    triangles.push_back(corner);
    triangle_edges.push_back(edge);
    vertex_count = std::max({vertex_count, corner[0] + 1, corner[1] + 1, corner[2] + 1});
  }
}

SurfaceEquations::SurfaceEquations(const SurfaceTopology* topology)
    : topology_(topology),
      accumulators_(topology->triangles.size() * kStride, 0.0f),
      slot_of_vertex_(static_cast<std::size_t>(topology->vertex_count), -1) {}

void SurfaceEquations::reset() {
  std::fill(accumulators_.begin(), accumulators_.end(), 0.0f);
  vertices_current_ = false;
}

void SurfaceEquations::add(int triangle, float b0, float b1, float b2, float m_xx, float m_xy,
                           float m_yy, float v_x, float v_y) {
  const float b[3] = {b0, b1, b2};
  const float pair[6] = {b0 * b0, b1 * b1, b2 * b2, b1 * b2, b2 * b0, b0 * b1};
  float* a = accumulators_.data() + std::size_t{kStride} * triangle;
  for (int k = 0; k < 6; ++k) {
    a[3 * k] += pair[k] * m_xx;
    a[3 * k + 1] += pair[k] * m_xy;
    a[3 * k + 2] += pair[k] * m_yy;
  }
  for (int k = 0; k < 3; ++k) {
    a[18 + 2 * k] += b[k] * v_x;
    a[19 + 2 * k] += b[k] * v_y;
  }
  vertices_current_ = false;
}

float* SurfaceEquations::accumulators() {
  vertices_current_ = false;
  return accumulators_.data();
}

const std::vector<int>& SurfaceEquations::touched_vertices() {
  if (vertices_current_) return touched_vertices_;
  std::fill(slot_of_vertex_.begin(), slot_of_vertex_.end(), -1);
  touched_triangles_.clear();
  for (std::size_t t = 0; t < topology_->triangles.size(); ++t) {
    const float* a = accumulators_.data() + kStride * t;
    // The trace of the sum of the corners' diagonal blocks vanishes only if nothing was added, or
    // only points with no gradient.
    if (a[0] + a[2] + a[3] + a[5] + a[6] + a[8] <= 0.0f) continue;
    touched_triangles_.push_back(static_cast<int>(t));
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

void SurfaceEquations::assemble(const Motion& motion, double scale, NormalEquations& out) {
  touched_vertices();
  const Eigen::Index columns = motion.cols();
  // Gather the triangles' accumulators into one 2x2 block per vertex and edge.
  vertex_blocks_.assign(5 * touched_vertices_.size(), 0.0f);
  edge_blocks_.assign(3 * topology_->edges.size(), 0.0f);
  touched_edges_.clear();
  for (int t : touched_triangles_) {
    const float* a = accumulators_.data() + std::size_t{kStride} * t;
    for (int k = 0; k < 3; ++k) {
      float* block = vertex_blocks_.data() + 5 * slot_of_vertex_[topology_->triangles[t][k]];
      for (int j = 0; j < 3; ++j) block[j] += a[3 * k + j];
      block[3] += a[18 + 2 * k];
      block[4] += a[19 + 2 * k];
      const int edge = topology_->triangle_edges[t][k];
      float* pair = edge_blocks_.data() + std::size_t{3} * edge;
      if (pair[0] == 0.0f && pair[2] == 0.0f) touched_edges_.push_back(edge);
      for (int j = 0; j < 3; ++j) pair[j] += a[9 + 3 * k + j];
    }
  }
  std::sort(touched_edges_.begin(), touched_edges_.end());
  touched_edges_.erase(std::unique(touched_edges_.begin(), touched_edges_.end()),
                       touched_edges_.end());

  product_.resize(motion.rows(), columns);
  Eigen::VectorXf gradient = Eigen::VectorXf::Zero(columns);
  const auto add_product = [&](int to, int from, const float* m) {
    product_.row(2 * to) += m[0] * motion.row(2 * from) + m[1] * motion.row(2 * from + 1);
    product_.row(2 * to + 1) += m[1] * motion.row(2 * from) + m[2] * motion.row(2 * from + 1);
  };
  for (std::size_t i = 0; i < touched_vertices_.size(); ++i) {
    const int slot = static_cast<int>(i);
    const float* m = vertex_blocks_.data() + 5 * i;
    product_.row(2 * slot) = m[0] * motion.row(2 * slot) + m[1] * motion.row(2 * slot + 1);
    product_.row(2 * slot + 1) = m[1] * motion.row(2 * slot) + m[2] * motion.row(2 * slot + 1);
    gradient +=
        m[3] * motion.row(2 * slot).transpose() + m[4] * motion.row(2 * slot + 1).transpose();
  }
  for (int edge : touched_edges_) {
    const int a = slot_of_vertex_[topology_->edges[edge][0]];
    const int b = slot_of_vertex_[topology_->edges[edge][1]];
    const float* m = edge_blocks_.data() + std::size_t{3} * edge;
    add_product(a, b, m);
    add_product(b, a, m);
  }
  Eigen::MatrixXf hessian = Eigen::MatrixXf::Zero(columns, columns);
  hessian.triangularView<Eigen::Lower>() = motion.transpose() * product_;
  hessian.triangularView<Eigen::StrictlyUpper>() = hessian.transpose();
  out.hessian += scale * hessian.cast<double>();
  out.gradient += scale * gradient.cast<double>();
}

}  // namespace semblance
