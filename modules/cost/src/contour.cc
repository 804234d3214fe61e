#include "semblance/cost/contour.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace semblance {

namespace {

constexpr double kRobustWidth = 4.0;
constexpr double kSampleCorrelation_px = 3.0;  // neighbours on a line are one observation

/// One line across the outline.
struct Line {
  const ContourEdge* edge;
  int side;  // which of the edge's triangles is seen from the front
  Eigen::Vector2f point, normal;
  float length_px;
};

Eigen::Vector2f projected(const Synthesis& synthesis, int vertex) {
  const float* p = synthesis.projected.data() + std::ptrdiff_t{3} * vertex;
  return {p[0], p[1]};
}

double twice_area(const Synthesis& synthesis, const std::array<int, 3>& corner) {
  const Eigen::Vector2f a = projected(synthesis, corner[0]);
  const Eigen::Vector2f b = projected(synthesis, corner[1]) - a;
  const Eigen::Vector2f c = projected(synthesis, corner[2]) - a;
  return double{b.x()} * c.y() - double{b.y()} * c.x();
}

bool inside_image(const ObservationLevel& image, const Eigen::Vector2f& at) {
  return at.x() >= 0.0f && at.y() >= 0.0f && at.x() < static_cast<float>(image.width) &&
         at.y() < static_cast<float>(image.height);
}

int pixel_at(const ObservationLevel& image, const Eigen::Vector2f& at) {
  return static_cast<int>(at.y()) * image.width + static_cast<int>(at.x());
}

bool shows_surface(const VisiblePixels& seen, int pixel) {
  return std::binary_search(seen.pixel.begin(), seen.pixel.end(), pixel);
}

/// Histograms of colours of the surface and beside it.
class RegionColours {
 public:
  void add(bool surface, const float* encoded) {
    (surface ? surface_ : beside_)[bin(encoded)] += 1.0f;
    (surface ? surface_total_ : beside_total_) += 1.0f;
  }
  bool known() const { return surface_total_ > 0.0f && beside_total_ > 0.0f; }
  /// Probability of the surface where this colour is seen, before any other knowledge.
  float surface_given(const float* encoded) const {
    constexpr float kUnseen = 0.005f;  // share of either: rarer colours say little
    const std::size_t i = bin(encoded);
    const float on = surface_[i] / surface_total_ + kUnseen;
    const float off = beside_[i] / beside_total_ + kUnseen;
    constexpr float kDoubt = 0.05f;
    return kDoubt + (1.0f - 2.0f * kDoubt) * on / (on + off);
  }

 private:
  static constexpr int kSide = 16, kBins = kSide * kSide * kSide;
  static std::size_t bin(const float* encoded) {
    std::size_t index = 0;
    for (int c = 0; c < 3; ++c) {
      const int level = std::clamp(static_cast<int>(encoded[c] * kSide), 0, kSide - 1);
      index = index * kSide + static_cast<std::size_t>(level);
    }
    return index;
  }
  std::vector<float> surface_ = std::vector<float>(kBins, 0.0f), beside_ = surface_;
  float surface_total_ = 0.0f, beside_total_ = 0.0f;
};

std::optional<Line> line_across(const Synthesis& synthesis, const ObservationLevel& observation,
                                const SurfaceTopology& topology, const ContourEdge& edge,
                                double reach_px) {
  const double first = twice_area(synthesis, topology.triangles[edge.triangle[0]]);
  const double second = twice_area(synthesis, topology.triangles[edge.triangle[1]]);
  if (!(first * second < 0.0)) return std::nullopt;
  Line line;
  line.edge = &edge;
  // Seen from the front, triangles turn against the clock; y points down in the image.
  line.side = first < 0.0 ? 0 : 1;
  const Eigen::Vector2f a = projected(synthesis, edge.vertex[0]);
  const Eigen::Vector2f b = projected(synthesis, edge.vertex[1]);
  line.point = 0.5f * (a + b);
  line.length_px = (b - a).norm();
  if (!(line.length_px > 1e-3f)) return std::nullopt;
  line.normal = Eigen::Vector2f(b.y() - a.y(), a.x() - b.x()) / line.length_px;
  for (int vertex : topology.triangles[edge.triangle[line.side]]) {
    if (vertex == edge.vertex[0] || vertex == edge.vertex[1]) continue;
    if (line.normal.dot(projected(synthesis, vertex) - line.point) > 0.0f) line.normal *= -1.0f;
  }
  const auto reach = static_cast<float>(reach_px);
  for (float r : {-2.0f * reach, 2.0f * reach}) {
    if (!inside_image(observation, line.point + r * line.normal)) return std::nullopt;
  }
  // Behind a part that is nearer, or in front of another, an outline is no edge of the surface.
  const auto shows = [&](float r) {
    return shows_surface(synthesis.pixels, pixel_at(observation, line.point + r * line.normal));
  };
  if (!shows(-1.5f) || shows(1.5f) || shows(0.5f * reach) || shows(reach)) return std::nullopt;
  return line;
}

/// Mean and deviation of the edge's place on the line, from the outline, in pixels.
struct Place {
  double mean = 0.0, deviation = 0.0;
};

std::optional<Place> find_edge(const Line& line, const ObservationLevel& observation,
                               const RegionColours& colours, double reach_px) {
  const int reach = std::max(2, static_cast<int>(std::lround(reach_px)));
  // cost[d + reach]: colours up to d are the surface's, farther ones are not.
  std::vector<double> cost(static_cast<std::size_t>(2 * reach + 1), 0.0);
  for (int r = -2 * reach; r < 2 * reach; ++r) {
    const Eigen::Vector2f at = line.point + (static_cast<float>(r) + 0.5f) * line.normal;
    const float p = colours.surface_given(observation.colour(pixel_at(observation, at)));
    const double on = -std::log(p), off = -std::log(1.0f - p);
    for (int d = -reach; d <= reach; ++d) {
      cost[static_cast<std::size_t>(d + reach)] += (r < d ? on : off) / kSampleCorrelation_px;
    }
  }
  const double least = *std::min_element(cost.begin(), cost.end());
  double sum = 0.0, first = 0.0, second = 0.0;
  for (int d = -reach; d <= reach; ++d) {
    const double w = std::exp(least - cost[static_cast<std::size_t>(d + reach)]);
    sum += w;
    first += w * d;
    second += w * d * d;
  }
  Place place;
  place.mean = first / sum;
  place.deviation = std::sqrt(std::max(0.0, second / sum - place.mean * place.mean));
  // All surface or none of it: the edge is elsewhere.
  if (std::abs(place.mean) > 0.75 * reach || place.deviation > 0.5 * reach) return std::nullopt;
  return place;
}

}  // namespace

std::vector<ContourEdge> contour_edges(const SurfaceTopology& topology,
                                       const std::vector<float>& vertex_weight) {
  std::vector<std::array<int, 2>> triangles(static_cast<std::size_t>(topology.edge_count),
                                            {-1, -1});
  std::vector<std::array<int, 2>> vertices(triangles.size());
  for (std::size_t t = 0; t < topology.triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const auto e = static_cast<std::size_t>(topology.triangle_edges[t][k]);
      (triangles[e][0] < 0 ? triangles[e][0] : triangles[e][1]) = static_cast<int>(t);
      vertices[e] = {topology.triangles[t][(k + 1) % 3], topology.triangles[t][(k + 2) % 3]};
    }
  }
  std::vector<ContourEdge> out;
  for (std::size_t e = 0; e < triangles.size(); ++e) {
    if (triangles[e][1] < 0) continue;
    float least = 1.0f;
    for (int t : triangles[e]) {
      for (int v : topology.triangles[static_cast<std::size_t>(t)]) {
        least = std::min(least, vertex_weight[static_cast<std::size_t>(v)]);
      }
    }
    if (least > 0.0f) out.push_back({triangles[e], vertices[e], least});
  }
  return out;
}

std::vector<ContourTarget> find_contour(const Synthesis& synthesis,
                                        const ObservationLevel& observation,
                                        const SurfaceTopology& topology,
                                        const std::vector<float>& triangle_weight,
                                        const std::vector<ContourEdge>& edges,
                                        const ContourOptions& options) {
  std::vector<Line> lines;
  for (const ContourEdge& edge : edges) {
    if (auto line = line_across(synthesis, observation, topology, edge, options.reach_px)) {
      lines.push_back(*line);
    }
  }
  RegionColours colours;
  const VisiblePixels& seen = synthesis.pixels;
  if (!lines.empty()) {
    for (std::size_t i = 0; i < seen.size(); ++i) {
      if (triangle_weight[static_cast<std::size_t>(seen.triangle[i])] >= 0.5f) {
        colours.add(true, observation.colour(seen.pixel[i]));
      }
    }
  }
  for (const Line& line : lines) {
    const int reach = static_cast<int>(std::lround(options.reach_px));
    for (int r = reach / 2; r < 2 * reach; ++r) {
      const int pixel = pixel_at(observation, line.point + static_cast<float>(r) * line.normal);
      if (!shows_surface(seen, pixel)) colours.add(false, observation.colour(pixel));
    }
  }
  std::vector<ContourTarget> out;
  if (!colours.known()) return out;
  for (const Line& line : lines) {
    const auto place = find_edge(line, observation, colours, options.reach_px);
    if (!place) continue;
    ContourTarget target;
    target.triangle = line.edge->triangle[line.side];
    const auto& corner = topology.triangles[static_cast<std::size_t>(target.triangle)];
    for (int k = 0; k < 3; ++k) {
      const bool on_edge = corner[k] == line.edge->vertex[0] || corner[k] == line.edge->vertex[1];
      target.barycentric[k] = on_edge ? 0.5f : 0.0f;
    }
    target.normal = line.normal;
    target.target_px = line.point + static_cast<float>(place->mean) * line.normal;
    target.sigma_px = static_cast<float>(std::hypot(place->deviation, options.sigma_px));
    target.weight = line.edge->weight * line.length_px / static_cast<float>(options.correlation_px);
    out.push_back(target);
  }
  return out;
}

ContourTarget::Loss ContourTarget::loss(const Eigen::Vector2f& seen_px) const {
  const double residual = normal.dot(seen_px - target_px) / sigma_px;
  const double q = 1.0 / (1.0 + residual * residual / (kRobustWidth * kRobustWidth));
  const double pull = weight * q * q / sigma_px;
  return {0.5 * weight * residual * residual * q, pull * residual, pull / sigma_px};
}

ContourCost::ContourCost(std::vector<ContourTarget> targets, const SurfaceTopology* topology)
    : targets_(std::move(targets)), topology_(topology) {}

double ContourCost::evaluate(const Synthesis& synthesis, SurfaceEquations* surface,
                             NormalEquations* direct) const {
  (void)direct;
  double cost = 0.0;
  for (const ContourTarget& target : targets_) {
    const auto& corner = topology_->triangles[static_cast<std::size_t>(target.triangle)];
    Eigen::Vector2f seen = Eigen::Vector2f::Zero();
    for (int k = 0; k < 3; ++k) {
      seen += target.barycentric[k] * projected(synthesis, corner[k]);
    }
    const ContourTarget::Loss loss = target.loss(seen);
    cost += loss.cost;
    if (surface != nullptr) {
      const Eigen::Vector2f& n = target.normal;
      const auto m = static_cast<float>(loss.curvature), v = static_cast<float>(loss.slope);
      surface->add(target.triangle, target.barycentric[0], target.barycentric[1],
                   target.barycentric[2], m * n.x() * n.x(), m * n.x() * n.y(), m * n.y() * n.y(),
                   v * n.x(), v * n.y());
    }
  }
  return cost;
}

}  // namespace semblance
