// The default differentiation of Objective, and the contract of objectives itself.
#include "semblance/optim/objective.h"

#include <gmock/gmock.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "semblance/core/random.h"
#include "semblance/core/rigid3.h"
#include "semblance/optim/contract.h"

namespace semblance {
namespace {

/// A curve fit with a bounded, a free and a rotation block; only `evaluate` is given.
class Toy : public Objective {
 public:
  Toy()
      : space_({scalar_block("a", "1", 0.0, 2.0, 1.0, 0.5, ""), rotation_block("r", ""),
                scalar_block("b", "m", -10.0, 10.0, 0.0, 2.0, "")}) {}
  const ParameterSpace& space() const override { return space_; }
  double evaluate(const Eigen::VectorXd& x) const override {
    return 0.5 * residuals(x).squaredNorm();
  }

  Eigen::VectorXd residuals(const Eigen::VectorXd& x) const {
    const Eigen::Quaterniond q(x[1], x[2], x[3], x[4]);
    const Eigen::Vector3d turned = q * Eigen::Vector3d(1.0, 2.0, 3.0);
    Eigen::VectorXd r(5);
    r << turned - Eigen::Vector3d(2.0, 1.0, 2.5), std::exp(x[0]) - 2.0 * x[5], x[5] * x[0] - 0.7;
    return r;
  }
  Eigen::MatrixXd jacobian(const Eigen::VectorXd& x) const {
    const Eigen::Quaterniond q(x[1], x[2], x[3], x[4]);
    const Eigen::Vector3d p = q * Eigen::Vector3d(1.0, 2.0, 3.0);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(5, 5);
    J.block<3, 3>(0, 1) << 0, p.z(), -p.y(), -p.z(), 0, p.x(), p.y(), -p.x(), 0;
    J(3, 0) = std::exp(x[0]);
    J(3, 4) = -2.0;
    J(4, 0) = x[5];
    J(4, 4) = x[0];
    return J;
  }

 private:
  ParameterSpace space_;
};

/// The same with its normal equations, optionally spoilt.
class AnalyticToy final : public Toy {
 public:
  explicit AnalyticToy(double gradient_error = 0.0) : gradient_error_(gradient_error) {}
  bool normal_equations(const Eigen::VectorXd& x, NormalEquations& out) const override {
    const Eigen::MatrixXd J = jacobian(x);
    out.hessian = J.transpose() * J;
    out.gradient = J.transpose() * residuals(x);
    out.gradient[2] *= 1.0 + gradient_error_;
    out.cost = evaluate(x);
    return true;
  }

 private:
  double gradient_error_;
};

std::vector<Eigen::VectorXd> some_points(const ParameterSpace& space) {
  Random random(4);
  std::vector<Eigen::VectorXd> points;
  for (int i = 0; i < 5; ++i) {
    points.push_back(space.plus(space.initial(), 0.4 * random.normal_vector(space.tangent_size())));
  }
  return points;
}

TEST(ObjectiveContract, HoldsForAnalyticNormalEquations) {
  const AnalyticToy toy;
  EXPECT_OBJECTIVE_CONTRACT(toy, some_points(toy.space()), {});
}

TEST(ObjectiveContract, HoldsForTheDefaultDifferences) {
  const Toy toy;
  ObjectiveAccuracy accuracy;
  accuracy.gauss_newton = false;
  EXPECT_OBJECTIVE_CONTRACT(toy, some_points(toy.space()), accuracy);
}

TEST(ObjectiveContract, FindsAWrongGradient) {
  const AnalyticToy toy(0.01);
  EXPECT_THAT(objective_contract_violations(toy, some_points(toy.space()), {}),
              ::testing::HasSubstr("gradient: off differences"));
}

TEST(DefaultNormalEquations, AreExactForQuadraticsAlsoOnTheBounds) {
  class Bowl final : public Objective {
   public:
    Bowl()
        : space_({scalar_block("a", "1", -1.0, 1.0, 0.0, 0.5, ""),
                  scalar_block("b", "1", -1.0, 1.0, 0.0, 2.0, ""),
                  scalar_block("fixed", "1", 0.5, 0.5, 0.5, 1.0, "")}) {}
    const ParameterSpace& space() const override { return space_; }
    double evaluate(const Eigen::VectorXd& x) const override {
      const double outside = (x.head(2).cwiseAbs().array() > 1.0).any() || x[2] != 0.5
                                 ? std::numeric_limits<double>::infinity()
                                 : 0.0;
      return 3.0 + x[0] * x[0] + x[0] * x[1] + 2.0 * x[1] * x[1] + x[2] + outside;
    }

   private:
    ParameterSpace space_;
  };
  const Bowl bowl;
  for (const Eigen::Vector2d& at : {Eigen::Vector2d(0.3, -0.2), Eigen::Vector2d(1.0, -1.0)}) {
    NormalEquations model;
    ASSERT_TRUE(bowl.normal_equations(Eigen::Vector3d(at[0], at[1], 0.5), model));
    Eigen::Matrix3d hessian;
    hessian << 2, 1, 0, 1, 4, 0, 0, 0, 0;
    EXPECT_LT((model.hessian - hessian).norm(), 1e-5);
    EXPECT_LT((model.gradient - hessian * Eigen::Vector3d(at[0], at[1], 0.0)).norm(), 1e-7);
  }
}

TEST(DefaultNormalEquations, RefuseWhereTheCostIsInfinite) {
  class Nowhere final : public Toy {
   public:
    double evaluate(const Eigen::VectorXd&) const override {
      return std::numeric_limits<double>::infinity();
    }
  };
  NormalEquations model;
  EXPECT_FALSE(Nowhere().normal_equations(Nowhere().space().initial(), model));
}

}  // namespace
}  // namespace semblance
