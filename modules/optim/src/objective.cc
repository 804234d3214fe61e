#include "semblance/optim/objective.h"

#include <Eigen/Eigenvalues>
#include <cmath>

#include "semblance/core/parallel.h"

namespace semblance {
namespace {

/// Steps h and a centre within the bounds such that centre +- h stays inside them.
struct Stencil {
  Eigen::VectorXd step, centre;
};

Stencil make_stencil(const ParameterSpace& space, const Eigen::VectorXd& x) {
  constexpr double relative_step = 1e-4;  // about the fourth root of the rounding unit
  Eigen::VectorXd lower, upper;
  space.tangent_bounds(x, lower, upper);
  Stencil stencil;
  stencil.step = (relative_step * space.tangent_scale()).cwiseMin(0.5 * (upper - lower));
  stencil.centre = Eigen::VectorXd::Zero(space.tangent_size())
                       .cwiseMax(lower + stencil.step)
                       .cwiseMin(upper - stencil.step);
  return stencil;
}

/// The symmetric matrix with every eigenvalue replaced by its magnitude, so that Newton steps
/// descend at saddles too (Greenstadt 1967).
Eigen::MatrixXd with_positive_curvature(const Eigen::MatrixXd& hessian) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(hessian);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseAbs().asDiagonal() *
         eigen.eigenvectors().transpose();
}

}  // namespace

void Objective::evaluate_batch(std::span<const Eigen::VectorXd> xs, std::span<double> costs) const {
  parallel_for(xs.size(), [&](std::size_t i) { costs[i] = evaluate(xs[i]); });
}

bool Objective::normal_equations(const Eigen::VectorXd& x, NormalEquations& out) const {
  const Eigen::Index n = space().tangent_size();
  const Stencil stencil = make_stencil(space(), x);
  const Eigen::VectorXd& h = stencil.step;

  // Order: x, centre, centre +- h_i, then four corners for each pair of directions.
  std::vector<Eigen::VectorXd> points{x, space().plus(x, stencil.centre)};
  const auto add = [&](Eigen::Index i, double a, Eigen::Index j, double b) {
    Eigen::VectorXd d = stencil.centre;
    d[i] += a * h[i];
    d[j] += b * h[j];
    points.push_back(space().plus(x, d));
  };
  for (Eigen::Index i = 0; i < n; ++i) {
    add(i, 1.0, i, 0.0);
    add(i, -1.0, i, 0.0);
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      for (const double a : {1.0, -1.0}) {
        for (const double b : {1.0, -1.0}) add(i, a, j, b);
      }
    }
  }
  std::vector<double> costs(points.size());
  evaluate_batch(points, costs);
  for (const double cost : costs) {
    if (!std::isfinite(cost)) return false;
  }

  out.reset(n);
  out.cost = costs[0];
  std::size_t corner = 2 + 2 * static_cast<std::size_t>(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double above = costs[2 + 2 * i], below = costs[3 + 2 * i];
    if (h[i] > 0.0) {
      out.gradient[i] = (above - below) / (2.0 * h[i]);
      out.hessian(i, i) = (above - 2.0 * costs[1] + below) / (h[i] * h[i]);
    }
    for (Eigen::Index j = 0; j < i; ++j, corner += 4) {
      if (h[i] <= 0.0 || h[j] <= 0.0) continue;
      const double twist =
          costs[corner] - costs[corner + 1] - costs[corner + 2] + costs[corner + 3];
      out.hessian(i, j) = out.hessian(j, i) = twist / (4.0 * h[i] * h[j]);
    }
  }
  out.gradient -= out.hessian * stencil.centre;  // from the centre back to x
  out.hessian = with_positive_curvature(out.hessian);
  return true;
}

}  // namespace semblance
