// Distance between a surface's outline and the edge of its colours in the image.
#pragma once

#include <vector>

#include "semblance/cost/cost.h"
#include "semblance/cost/observation.h"

namespace semblance {

/// A place on the outline, and the line in the image on which it should lie.
struct ContourTarget {
  int triangle = 0;
  std::array<float, 3> barycentric{1, 0, 0};
  Eigen::Vector2f normal;  // unit, out of the surface
  Eigen::Vector2f target_px;
  float sigma_px = 1.0f;
  float weight = 1.0f;  // independent observations it stands for

  /// Geman-McClure's loss of the distance, its derivative by a step along `normal` and the
  /// Gauss-Newton curvature (per pixel and pixel^2), for the place seen at `seen_px`.
  struct Loss {
    double cost, slope, curvature;
  };
  Loss loss(const Eigen::Vector2f& seen_px) const;
};

/// Edges of a surface that may be compared with what the image shows beside it.
struct ContourEdge {
  std::array<int, 2> triangle;
  std::array<int, 2> vertex;
  float weight;  // in (0, 1]
};

/// Edges between two triangles, where the weights of all their corners (0 to 1 per vertex) are
/// positive; the edge's weight is the least of them.
std::vector<ContourEdge> contour_edges(const SurfaceTopology& topology,
                                       const std::vector<float>& vertex_weight);

struct ContourOptions {
  double reach_px = 8.0;         // the edge is sought so far to both sides of the outline
  double sigma_px = 1.0;         // of the outline itself: what the surface's shape gets wrong
  double correlation_px = 10.0;  // length of outline whose errors are alike
};

/// Where the outline at this synthesis should be: for each edge with one triangle seen from the
/// front and one from behind, beside which no other part of the surface shows, the colours along
/// its normal are split into the surface's and those beside it where that explains them best, as
/// in region-based tracking (Hexner and Hagege, Int. J. Comput. Vis. 118, 2016; Stoiber et al.,
/// ACCV 2020, section 3). The surface's colours are the histogram of all its pixels of positive
/// weight, those beside it that of what lies farther out along the normals. Edges whose
/// surroundings look like the surface, or do not show it, are left out.
std::vector<ContourTarget> find_contour(const Synthesis& synthesis,
                                        const ObservationLevel& observation,
                                        const SurfaceTopology& topology,
                                        const std::vector<float>& triangle_weight,
                                        const std::vector<ContourEdge>& edges,
                                        const ContourOptions& options);

/// Residuals normal . (projection - target) / sigma, each counted `weight` times.
class ContourCost : public Cost {
 public:
  ContourCost(std::vector<ContourTarget> targets, const SurfaceTopology* topology);
  std::string name() const override { return "contour"; }
  std::string unit() const override { return "px"; }
  double evaluate(const Synthesis& synthesis, SurfaceEquations* surface,
                  NormalEquations* direct) const override;

 private:
  std::vector<ContourTarget> targets_;
  const SurfaceTopology* topology_;
};

}  // namespace semblance
