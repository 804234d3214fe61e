// The outline of the drawn mesh, against the edges that a picture shows for it.
#pragma once

#include <vector>

#include "object_objective.h"
#include "semblance/cost/contour.h"

namespace semblance {

/// ContourCost, all of whose edges may be found farther out or in by the same amount: blur, light
/// from one side and a texture's own edges see to it. That offset is one more parameter, of
/// deviation kOffset_px, which is eliminated by a Schur complement; the cost is that after its own
/// Gauss-Newton step. Where a texture tells the object's size, it tells the offset too.
class OutlineComparison {
 public:
  OutlineComparison(std::vector<ContourTarget> targets, const SurfaceTopology& topology);

  double cost(const Synthesis& synthesis) const;
  /// Adds cost and equations of a picture's parameters.
  void add(const ObjectObjective& objective, const Eigen::VectorXd& x, std::size_t picture,
           const Synthesis& synthesis, NormalEquations& out) const;

  /// Gradients by groups of targets, a column each, and last that of an offset by its deviation.
  /// `group` has one entry per target.
  Eigen::MatrixXd scores(const ObjectObjective& objective, const Eigen::VectorXd& x,
                         std::size_t picture, const Synthesis& synthesis,
                         const std::vector<std::size_t>& group, std::size_t groups) const;

  const std::vector<ContourTarget>& targets() const { return targets_; }

 private:
  /// The edges where they were found, and moved in and out.
  struct Moved {
    Moved(const std::vector<ContourTarget>& targets, const SurfaceTopology& topology);
    ContourCost in, found, out;
  };
  /// Derivatives of the cost by the offset.
  struct Slope {
    double cost, gradient, curvature;
  };
  static Slope slope(const Moved& moved, const Synthesis& synthesis);

  std::vector<ContourTarget> targets_;
  const SurfaceTopology& topology_;
  Moved all_;
};

}  // namespace semblance
