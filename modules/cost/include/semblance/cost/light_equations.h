// Least squares for the light on a surface of known colours.
#pragma once

#include <Eigen/Core>
#include <array>

#include "semblance/core/scene.h"

namespace semblance {

/// Sums over surface points; their light is that which explains the sums best.
class LightEquations {
 public:
  LightEquations();
  /// A point with `basis` = sh_basis(normal). Albedo and what is seen are encoded RGB; the error of
  /// the linear intensity is weighted so that `weight` is that of the encoded one, to first order.
  void add(const std::array<float, 9>& basis, const float* albedo, const float* observed,
           double weight);
  /// Solves each channel with a pull towards `before`, relative to the data's weight on the ambient
  /// term. `order`: of the harmonics that may change, 1 (ambient and direction) or 2. Channels that
  /// cannot be solved keep `before`.
  ShLight solve(const ShLight& before, double pull, int order) const;

 private:
  std::array<Eigen::Matrix<double, 9, 9>, 3> normal_;
  std::array<Eigen::Matrix<double, 9, 1>, 3> right_;
};

}  // namespace semblance
