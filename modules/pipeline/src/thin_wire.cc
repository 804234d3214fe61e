#include "thin_wire.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <queue>

namespace semblance {
namespace {

struct Link {
  int to;
  float length;
};

/// Rows of the mesh with those doubled along texture seams merged: the first of each place.
std::vector<int> merged_rows(const Mesh& mesh) {
  std::map<std::array<double, 3>, int> first;
  std::vector<int> merged(static_cast<std::size_t>(mesh.vertex_count()));
  for (int v = 0; v < mesh.vertex_count(); ++v) {
    const auto p = mesh.positions_m.row(v);
    merged[v] = first.try_emplace({p.x(), p.y(), p.z()}, v).first->second;
  }
  return merged;
}

class Sampler {
 public:
  explicit Sampler(const Mesh& mesh)
      : merged_(merged_rows(mesh)),
        links_(merged_.size()),
        distance_(merged_.size(), std::numeric_limits<float>::infinity()),
        owner_(merged_.size(), -1) {
    collect_triangles(mesh);
    collect_parts(mesh);
  }

  ThinWire sample(int count) {
    std::vector<int> seeds;
    for (const int start : part_starts_) add_seed(start, seeds);
    // Farthest so far, with stale entries: a distance only ever shrinks.
    std::priority_queue<std::pair<float, int>> farthest;
    for (const int v : kept_) farthest.emplace(distance_[v], -v);
    while (static_cast<int>(seeds.size()) < count && !farthest.empty()) {
      const auto [distance, negated] = farthest.top();
      farthest.pop();
      const int v = -negated;
      if (distance_[v] <= 0.0f) continue;
      if (distance_[v] < distance) {
        farthest.emplace(distance_[v], negated);
        continue;
      }
      add_seed(v, seeds);
    }
    return {seeds, touching_cells()};
  }

 private:
  void collect_triangles(const Mesh& mesh) {
    double sum = 0.0;
    std::size_t count = 0;
    for (int t = 0; t < mesh.triangle_count(); ++t) {
      std::array<int, 3> corner{};
      for (int k = 0; k < 3; ++k) corner[k] = merged_[mesh.triangles(t, k)];
      triangles_.push_back(corner);
      for (int k = 0; k < 3; ++k) {
        const int a = corner[k], b = corner[(k + 1) % 3];
        if (a == b) continue;
        const float length =
            static_cast<float>((mesh.positions_m.row(a) - mesh.positions_m.row(b)).norm());
        links_[a].push_back({b, length});
        links_[b].push_back({a, length});
        sum += length;
        ++count;
      }
    }
    const float mean = count == 0 ? 1.0f : static_cast<float>(sum / static_cast<double>(count));
    for (auto& list : links_)
      for (Link& link : list) link.length = std::sqrt(link.length * mean);
  }

  /// Connected parts that are large enough; each starts from its lowest vertex number.
  void collect_parts(const Mesh& mesh) {
    std::vector<int> part(merged_.size(), -1), starts;
    for (int v = 0; v < static_cast<int>(merged_.size()); ++v) {
      if (part[v] >= 0 || links_[v].empty()) continue;
      flood(v, static_cast<int>(starts.size()), part);
      starts.push_back(v);
    }
    std::vector<double> area(starts.size(), 0.0);
    for (int t = 0; t < mesh.triangle_count(); ++t) {
      const Eigen::Vector3d a = mesh.positions_m.row(mesh.triangles(t, 0));
      const Eigen::Vector3d b = mesh.positions_m.row(mesh.triangles(t, 1));
      const Eigen::Vector3d c = mesh.positions_m.row(mesh.triangles(t, 2));
      const int p = part[triangles_[t][0]];
      if (p >= 0) area[p] += 0.5 * (b - a).cross(c - a).norm();
    }
    const double least = 0.05 * std::accumulate(area.begin(), area.end(), 0.0);
    for (std::size_t p = 0; p < starts.size(); ++p)
      if (area[p] > least) part_starts_.push_back(starts[p]);
    for (int v = 0; v < static_cast<int>(merged_.size()); ++v)
      if (part[v] >= 0 && area[part[v]] > least) kept_.push_back(v);
  }

  void flood(int start, int label, std::vector<int>& part) const {
    std::vector<int> open{start};
    part[start] = label;
    while (!open.empty()) {
      const int v = open.back();
      open.pop_back();
      for (const Link& link : links_[v]) {
        if (part[link.to] >= 0) continue;
        part[link.to] = label;
        open.push_back(link.to);
      }
    }
  }

  /// Gives the seed every vertex that is nearer to it than to any earlier one (Dijkstra).
  void add_seed(int seed, std::vector<int>& seeds) {
    const int cell = static_cast<int>(seeds.size());
    seeds.push_back(seed);
    using Entry = std::pair<float, int>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
    distance_[seed] = 0.0f;
    owner_[seed] = cell;
    open.emplace(0.0f, seed);
    while (!open.empty()) {
      const auto [distance, v] = open.top();
      open.pop();
      if (distance > distance_[v]) continue;
      for (const Link& link : links_[v]) {
        const float through = distance + link.length;
        if (through >= distance_[link.to]) continue;
        distance_[link.to] = through;
        owner_[link.to] = cell;
        open.emplace(through, link.to);
      }
    }
  }

  std::vector<std::array<int, 2>> touching_cells() const {
    std::vector<std::array<int, 2>> edges;
    for (const auto& corner : triangles_) {
      for (int k = 0; k < 3; ++k) {
        const int a = owner_[corner[k]], b = owner_[corner[(k + 1) % 3]];
        if (a >= 0 && b >= 0 && a != b) edges.push_back({std::min(a, b), std::max(a, b)});
      }
    }
    std::sort(edges.begin(), edges.end());
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    return edges;
  }

  std::vector<int> merged_;
  std::vector<std::vector<Link>> links_;
  std::vector<float> distance_;
  std::vector<int> owner_;
  std::vector<std::array<int, 3>> triangles_;
  std::vector<int> part_starts_, kept_;
};

}  // namespace

ThinWire thin_wire(const Mesh& mesh, int count) { return Sampler(mesh).sample(count); }

}  // namespace semblance
