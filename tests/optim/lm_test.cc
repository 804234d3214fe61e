// Levenberg-Marquardt, and Ceres as its cross-check, against closed forms and brute force.
#include <gmock/gmock.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "semblance/core/random.h"
#include "semblance/optim/contract.h"
#include "semblance/optim/optimizer.h"

namespace semblance {
namespace {

Eigen::MatrixXd random_matrix(Random& random, int rows, int columns) {
  Eigen::MatrixXd a(rows, columns);
  for (int j = 0; j < columns; ++j) a.col(j) = random.normal_vector(rows);
  return a;
}

/// |A x - b|^2 / 2 within -bound <= x <= bound.
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

/// Points b_i = scale * R a_i + t + noise: a similarity with a rotation block and bounds.
class Similarity final : public Objective {
 public:
  Similarity()
      : space_({rotation_block("rotation", ""), translation_block("translation", 10.0, ""),
                scalar_block("scale", "1", 0.1, 5.0, 1.0, 0.3, "")}) {
    Random random(8);
    from_ = random_matrix(random, 3, 20);
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(0.8, Eigen::Vector3d(1, -2, 1).normalized()).toRotationMatrix();
    to_ = (1.7 * turn * from_).colwise() + Eigen::Vector3d(0.5, -1.0, 2.0);
    to_ += 0.05 * random_matrix(random, 3, 20);
  }
  const ParameterSpace& space() const override { return space_; }
  double evaluate(const Eigen::VectorXd& x) const override {
    return 0.5 * (moved(x) - to_).squaredNorm();
  }
  bool normal_equations(const Eigen::VectorXd& x, NormalEquations& out) const override {
    const Eigen::Matrix3Xd turned = rotation(x) * from_;
    const Eigen::Matrix3Xd residuals = moved(x) - to_;
    out.reset(7);
    for (int i = 0; i < from_.cols(); ++i) {
      const Eigen::Vector3d p = x[7] * turned.col(i);
      Eigen::Matrix<double, 3, 7> J;
      J << 0, p.z(), -p.y(), 1, 0, 0, turned(0, i), -p.z(), 0, p.x(), 0, 1, 0, turned(1, i), p.y(),
          -p.x(), 0, 0, 0, 1, turned(2, i);
      out.hessian += J.transpose() * J;
      out.gradient += J.transpose() * residuals.col(i);
    }
    out.cost = evaluate(x);
    return true;
  }
  const Eigen::Matrix3Xd& from() const { return from_; }
  const Eigen::Matrix3Xd& to() const { return to_; }

 private:
  static Eigen::Matrix3d rotation(const Eigen::VectorXd& x) {
    return Eigen::Quaterniond(x[0], x[1], x[2], x[3]).toRotationMatrix();
  }
  Eigen::Matrix3Xd moved(const Eigen::VectorXd& x) const {
    return (x[7] * rotation(x) * from_).colwise() + Eigen::Vector3d(x.segment<3>(4));
  }
  ParameterSpace space_;
  Eigen::Matrix3Xd from_, to_;
};

OptimizerOptions tight_options() {
  OptimizerOptions options;
  options.max_iterations = 100;
  options.initial_damping = 1e-12;
  options.step_tolerance = 1e-9;
  options.cost_tolerance = 1e-15;
  return options;
}

class GradientMethod : public ::testing::TestWithParam<const char*> {
 protected:
  Solution solve(const Objective& objective, const Eigen::VectorXd& x0) const {
    return make_optimizer(GetParam(), tight_options())->minimize(objective, x0, silent_progress());
  }
};

TEST_P(GradientMethod, SolvesLinearLeastSquaresWithItsCovariance) {
  Random random(3);
  const Eigen::MatrixXd a = random_matrix(random, 30, 6);
  const Eigen::VectorXd b = random.normal_vector(30);
  const Solution solution =
      solve(LinearLeastSquares(a, b, 100.0), Eigen::VectorXd::Constant(6, 3.0));
  const Eigen::MatrixXd normal = a.transpose() * a;
  EXPECT_LT((solution.x - normal.ldlt().solve(a.transpose() * b)).norm(), 1e-10);
  ASSERT_TRUE(solution.covariance.has_value());
  EXPECT_LT((*solution.covariance - normal.inverse()).norm(), 1e-12);
  EXPECT_EQ(solution.termination, Termination::converged);
}

TEST_P(GradientMethod, HasNoCovarianceWhereTheDataDoNotReach) {
  Random random(3);
  Eigen::MatrixXd a = random_matrix(random, 30, 4);
  a.col(3) = a.col(1) - a.col(2);
  const Solution solution =
      solve(LinearLeastSquares(a, random.normal_vector(30), 100.0), Eigen::VectorXd::Zero(4));
  EXPECT_FALSE(solution.covariance.has_value());
  EXPECT_EQ(solution.termination, Termination::converged);
}

/// The bounded minimum: the best feasible point over all 3^n ways to hold entries on bounds.
Eigen::VectorXd enumerate_active_sets(const Eigen::MatrixXd& a, const Eigen::VectorXd& b,
                                      double bound) {
  const int n = static_cast<int>(a.cols());
  double best_cost = std::numeric_limits<double>::infinity();
  Eigen::VectorXd best;
  for (int code = 0; code < std::pow(3, n); ++code) {
    Eigen::VectorXd x = Eigen::VectorXd::Zero(n);
    std::vector<int> free;
    for (int i = 0, left = code; i < n; ++i, left /= 3) {
      if (left % 3 == 0) free.push_back(i);
      if (left % 3 == 1) x[i] = -bound;
      if (left % 3 == 2) x[i] = bound;
    }
    if (!free.empty()) {
      const Eigen::MatrixXd part = a(Eigen::all, free);
      const Eigen::VectorXd best_free =
          (part.transpose() * part).ldlt().solve(part.transpose() * (b - a * x));
      x(free) = best_free;
    }
    const double cost = 0.5 * (a * x - b).squaredNorm();
    if (x.cwiseAbs().maxCoeff() > bound * (1.0 + 1e-12) || cost >= best_cost) continue;
    best_cost = cost;
    best = x;
  }
  return best;
}

TEST_P(GradientMethod, FindsTheBoundedMinimumFromInsideAndFromEveryCorner) {
  Random random(17);
  for (int trial = 0; trial < 20; ++trial) {
    Eigen::MatrixXd a = random_matrix(random, 6, 4);
    a.col(1) = a.col(0) + 0.2 * a.col(1);  // strongly coupled
    const Eigen::VectorXd b = 2.0 * random.normal_vector(6);
    constexpr double bound = 0.4;
    const Eigen::VectorXd expected = enumerate_active_sets(a, b, bound);
    const LinearLeastSquares problem(a, b, bound);
    for (const int corner : {-1, 0, 5, 10, 15}) {
      Eigen::VectorXd x0 = Eigen::VectorXd::Zero(4);
      for (int i = 0; corner >= 0 && i < 4; ++i) x0[i] = (corner >> i & 1) != 0 ? bound : -bound;
      const Solution solution = solve(problem, x0);
      EXPECT_LT((solution.x - expected).norm(), 1e-6) << "trial " << trial << " corner " << corner;
    }
  }
}

TEST_P(GradientMethod, FindsTheSimilarityOfUmeyama) {
  const Similarity problem;
  const Solution solution = solve(problem, problem.space().initial());
  const Eigen::Matrix4d closed = Eigen::umeyama(problem.from(), problem.to(), true);
  const Eigen::Quaterniond q(solution.x[0], solution.x[1], solution.x[2], solution.x[3]);
  EXPECT_LT((solution.x[7] * q.toRotationMatrix() - closed.topLeftCorner<3, 3>()).norm(), 1e-7);
  EXPECT_LT((solution.x.segment<3>(4) - closed.topRightCorner<3, 1>()).norm(), 1e-7);
}

INSTANTIATE_TEST_SUITE_P(Each, GradientMethod, ::testing::Values("lm", "ceres"));

TEST(Similarity, KeepsTheObjectiveContract) {
  const Similarity problem;
  Random random(2);
  std::vector<Eigen::VectorXd> points;
  for (int i = 0; i < 4; ++i) {
    points.push_back(
        problem.space().plus(problem.space().initial(), 0.3 * random.normal_vector(7)));
  }
  EXPECT_OBJECTIVE_CONTRACT(problem, points, {});
}

TEST(LevenbergMarquardt, AgreesWithCeresOnCostAndCovariance) {
  const Similarity problem;
  const Eigen::VectorXd x0 = problem.space().initial();
  const Solution ours =
      make_optimizer("lm", tight_options())->minimize(problem, x0, silent_progress());
  const Solution theirs =
      make_optimizer("ceres", tight_options())->minimize(problem, x0, silent_progress());
  EXPECT_NEAR(ours.cost, theirs.cost, 1e-12 * ours.cost);
  ASSERT_TRUE(ours.covariance && theirs.covariance);
  EXPECT_LT((*ours.covariance - *theirs.covariance).norm(), 1e-8 * ours.covariance->norm());
  EXPECT_LE(ours.evaluations, theirs.evaluations);
}

TEST(LevenbergMarquardt, NeedsOneEvaluationPerStep) {
  Random random(3);
  const Eigen::MatrixXd a = random_matrix(random, 30, 6);
  const LinearLeastSquares problem(a, random.normal_vector(30), 100.0);
  const Solution solution =
      make_optimizer("lm", tight_options())
          ->minimize(problem, Eigen::VectorXd::Constant(6, 3.0), silent_progress());
  EXPECT_EQ(solution.evaluations, 2);  // the start and the end of the only step
}

}  // namespace
}  // namespace semblance
