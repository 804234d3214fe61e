#include "semblance/cost/contract.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <sstream>

#include "semblance/core/parallel.h"

namespace semblance {
namespace {

/// What the checks of one point share.
class Checker {
 public:
  Checker(const Cost& cost, const SurfaceTopology& topology, const ParameterSpace& space,
          const SynthesisAt& synthesis_at, const CostAccuracy& accuracy)
      : cost_(cost),
        topology_(topology),
        space_(space),
        synthesis_at_(synthesis_at),
        accuracy_(accuracy) {}

  void check(const Eigen::VectorXd& x);
  std::ostream& complain() { return violations_ << (violations_.tellp() > 0 ? "\n" : ""); }
  std::string violations() const { return violations_.str(); }

 private:
  double value(const Eigen::VectorXd& x) const;
  std::vector<float> projected(const Eigen::VectorXd& x) const;
  Eigen::VectorXd moved(const Eigen::VectorXd& x, Eigen::Index k, double sign) const;
  NormalEquations equations(const Eigen::VectorXd& x) const;
  SurfaceEquations::Motion motion(const Eigen::VectorXd& x, const std::vector<int>& vertices) const;
  void choose_steps(const Eigen::VectorXd& x);
  void check_value(const Eigen::VectorXd& x);
  void check_derivatives(const Eigen::VectorXd& x);

  const Cost& cost_;
  const SurfaceTopology& topology_;
  const ParameterSpace& space_;
  const SynthesisAt& synthesis_at_;
  CostAccuracy accuracy_;
  Eigen::VectorXd step_;  // of differences, per tangent entry
  std::ostringstream violations_;
};

double Checker::value(const Eigen::VectorXd& x) const {
  double out = 0.0;
  synthesis_at_(x, [&](const Synthesis& s) { out = cost_.evaluate(s, nullptr, nullptr); });
  return out;
}

std::vector<float> Checker::projected(const Eigen::VectorXd& x) const {
  std::vector<float> out;
  synthesis_at_(x, [&](const Synthesis& s) { out.assign(s.projected.begin(), s.projected.end()); });
  return out;
}

Eigen::VectorXd Checker::moved(const Eigen::VectorXd& x, Eigen::Index k, double sign) const {
  return space_.plus(x, sign * step_[k] * Eigen::VectorXd::Unit(step_.size(), k));
}

void Checker::choose_steps(const Eigen::VectorXd& x) {
  step_ = 0.01 * space_.tangent_scale();
  const std::vector<float> here = projected(x);
  for (Eigen::Index k = 0; k < step_.size(); ++k) {
    const std::vector<float> there = projected(moved(x, k, 1.0));
    double largest = 0.0;
    for (std::size_t i = 0; i < here.size(); ++i) {
      if (i % 3 != 2) largest = std::max(largest, std::abs(double{there[i]} - here[i]));
    }
    if (largest > accuracy_.step_px) step_[k] *= accuracy_.step_px / largest;
  }
}

SurfaceEquations::Motion Checker::motion(const Eigen::VectorXd& x,
                                         const std::vector<int>& vertices) const {
  const Eigen::Index columns = space_.tangent_size();
  SurfaceEquations::Motion out = SurfaceEquations::Motion::Zero(
      2 * static_cast<Eigen::Index>(vertices.size()), SurfaceEquations::padded_columns(columns));
  for (Eigen::Index k = 0; k < columns; ++k) {
    const std::vector<float> above = projected(moved(x, k, 1.0)),
                             below = projected(moved(x, k, -1.0));
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      for (int axis = 0; axis < 2; ++axis) {
        const std::size_t at = std::size_t{3} * vertices[i] + axis;
        out(2 * static_cast<Eigen::Index>(i) + axis, k) =
            static_cast<float>((double{above[at]} - below[at]) / (2.0 * step_[k]));
      }
    }
  }
  return out;
}

NormalEquations Checker::equations(const Eigen::VectorXd& x) const {
  NormalEquations out;
  out.reset(space_.tangent_size());
  SurfaceEquations surface(&topology_);
  synthesis_at_(x, [&](const Synthesis& s) { out.cost = cost_.evaluate(s, &surface, &out); });
  surface.assemble(motion(x, surface.touched_vertices()), out);
  return out;
}

void Checker::check_value(const Eigen::VectorXd& x) {
  const double first = value(x);
  if (!std::isfinite(first) || first < 0.0) complain() << "the cost is " << first;
  std::vector<double> again(16);
  parallel_for(again.size(), [&](std::size_t i) { again[i] = value(x); });
  for (const double other : again) {
    if (other == first) continue;
    complain() << "the cost is " << first << ", then " << other << " at the same x";
    break;
  }
}

void Checker::check_derivatives(const Eigen::VectorXd& x) {
  const NormalEquations found = equations(x);
  const double plain = value(x);
  if (!(std::abs(found.cost - plain) <= 1e-5 * (1.0 + plain))) {
    complain() << "the cost is " << plain << ", with derivatives " << found.cost;
  }
  const double least =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(found.hessian).eigenvalues().minCoeff();
  if (!(least >= -1e-4 * found.hessian.trace())) {
    complain() << "the Hessian has the eigenvalue " << least;
  }
  if (!std::isfinite(accuracy_.gradient)) return;
  Eigen::VectorXd expected(step_.size());
  for (Eigen::Index k = 0; k < step_.size(); ++k) {
    expected[k] = (value(moved(x, k, 1.0)) - value(moved(x, k, -1.0))) / (2.0 * step_[k]);
  }
  const double norm = expected.cwiseProduct(step_).norm();
  const double error = (found.gradient - expected).cwiseProduct(step_).norm();
  if (!(error <= accuracy_.gradient * norm)) {
    complain() << "the gradient is (" << found.gradient.transpose() << "), differences give ("
               << expected.transpose() << ")";
  }
}

void Checker::check(const Eigen::VectorXd& x) {
  choose_steps(x);
  check_value(x);
  check_derivatives(x);
}

}  // namespace

std::string cost_contract_violations(const Cost& cost, const SurfaceTopology& topology,
                                     const ParameterSpace& space, const SynthesisAt& synthesis_at,
                                     std::span<const Eigen::VectorXd> points,
                                     const CostAccuracy& accuracy) {
  Checker checker(cost, topology, space, synthesis_at, accuracy);
  if (cost.name().empty() || cost.unit().empty()) checker.complain() << "name or unit is empty";
  for (const Eigen::VectorXd& x : points) checker.check(x);
  return checker.violations();
}

}  // namespace semblance
