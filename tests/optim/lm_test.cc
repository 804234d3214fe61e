#include <gmock/gmock.h>

#include <Eigen/Dense>

#include "semblance/core/random.h"
#include "semblance/optim/optimizer.h"

namespace semblance {
namespace {

/// |A d - b|^2 / 2 with boxes, d = x.
class LinearLeastSquares final : public Objective {
 public:
  LinearLeastSquares(Eigen::MatrixXd a, Eigen::VectorXd b, double bound)
      : a_(std::move(a)), b_(std::move(b)) {
    ParameterBlock block;
    block.name = "x";
    block.size = static_cast<int>(a_.cols());
    block.lower = Eigen::VectorXd::Constant(block.size, -bound);
    block.upper = Eigen::VectorXd::Constant(block.size, bound);
    space_ = ParameterSpace({block});
  }
  const ParameterSpace& space() const override { return space_; }
  double evaluate(const Eigen::VectorXd& x) const override {
    return 0.5 * (a_ * x - b_).squaredNorm();
  }
  bool normal_equations(const Eigen::VectorXd& x, NormalEquations& out) const override {
    out.hessian = a_.transpose() * a_;
    out.gradient = a_.transpose() * (a_ * x - b_);
    out.cost = evaluate(x);
    return true;
  }

 private:
  Eigen::MatrixXd a_;
  Eigen::VectorXd b_;
  ParameterSpace space_;
};

TEST(LevenbergMarquardt, SolvesLinearLeastSquaresWithItsCovariance) {
  Random random(3);
  Eigen::MatrixXd a(30, 6);
  for (int j = 0; j < 6; ++j) a.col(j) = random.normal_vector(30);
  const Eigen::VectorXd b = random.normal_vector(30);
  const LinearLeastSquares problem(a, b, 100.0);
  OptimizerOptions options;
  options.initial_damping = 1e-12;
  const Solution solution =
      make_optimizer("lm", options)
          ->minimize(problem, Eigen::VectorXd::Constant(6, 3.0), silent_progress());
  const Eigen::MatrixXd normal = a.transpose() * a;
  EXPECT_LT((solution.x - normal.ldlt().solve(a.transpose() * b)).norm(), 1e-10);
  ASSERT_TRUE(solution.covariance.has_value());
  EXPECT_LT((*solution.covariance - normal.inverse()).norm(), 1e-12);
  EXPECT_EQ(solution.termination, Termination::converged);
  EXPECT_EQ(solution.evaluations, 2);
}

}  // namespace
}  // namespace semblance
