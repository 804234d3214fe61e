// What a cost must do to be minimised together with others.
#pragma once

#include <span>
#include <string>

#include "semblance/core/camera.h"
#include "semblance/core/scene.h"
#include "semblance/cost/surface_equations.h"
#include "semblance/render/visibility.h"

namespace semblance {

/// What one synthesis at one x offers to every cost: computed once, shared by all.
struct Synthesis {
  const ParameterSpace& space;  // of the free parameters
  const Eigen::VectorXd& x;     // the free parameters
  const Scene& scene;
  const Camera& camera;              // at the resolution of the comparison
  const VisiblePixels& pixels;       // of front faces only: what is seen from behind is left out
  std::span<const float> projected;  // (x_px, y_px, depth_m) per vertex
};

/// Sum of robust squared residuals / 2. Const functions may run in several threads at once.
///
/// To add a cost: implement the three functions in one file and check it with EXPECT_COST_CONTRACT
/// (cost/contract.h).
class Cost {
 public:
  virtual ~Cost() = default;
  virtual std::string name() const = 0;
  /// Unit of the residuals before they are divided by their standard deviation.
  virtual std::string unit() const = 0;
  /// The cost; where `surface` is not null also adds the residuals that live on the image of the
  /// surface to it, and those that depend on x directly to `direct` (tangent space of the space).
  virtual double evaluate(const Synthesis& synthesis, SurfaceEquations* surface,
                          NormalEquations* direct) const = 0;
};

}  // namespace semblance
