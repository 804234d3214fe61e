// A sweep surface as a model: every number that shapes it is a parameter.
#pragma once

#include <memory>

#include "semblance/geometry/sweep_surface.h"
#include "semblance/models/parametric_model.h"

namespace semblance {

/// A rigid motion ("rotation", "translation") and the surface's controls, one scalar block each
/// under the names of `SweepSurface::control_names`. Bounds are about the given surface's values,
/// such that every combination is a surface: positions within 30 % of the way to the next contour,
/// biases within a factor of 1.5, points within half the contour's radius. No priors. The Jacobian
/// is analytic.
class SweepModel final : public ParametricModel {
 public:
  /// `around` and `along` as in `SweepSurface::mesh`; the ends stay open.
  SweepModel(SweepSurface surface, int around, int along);

  const ParameterSpace& parameters() const override { return space_; }
  void synthesize(const Eigen::VectorXd& x, Scene& scene) const override;
  bool vertex_jacobian(const Eigen::VectorXd& x, const std::vector<int>& tangent_columns,
                       const std::vector<int>* vertices, VertexJacobian& out) const override;

 private:
  SweepSurface surface_at(const Eigen::VectorXd& x) const;

  SweepSurface surface_;
  int around_, along_;
  ParameterSpace space_;
  std::shared_ptr<const Mesh> mesh_;
};

}  // namespace semblance
