#include <gmock/gmock.h>

#include "semblance/cost/contract.h"
#include "semblance/cost/landmark.h"
#include "semblance/cost/photometric.h"
#include "semblance/cost/prior.h"
#include "sheet.h"

namespace semblance {
namespace {

using testing::Sheet;

SynthesisAt synthesis_of(const SynthesisObjective& objective) {
  return [&](const Eigen::VectorXd& x, const std::function<void(const Synthesis&)>& use) {
    objective.with_synthesis(x, use);
  };
}

/// Marks that are off by up to 20 pixels of an image of twice the size that is compared.
LandmarkCost make_landmarks(const Sheet& sheet) {
  std::vector<LandmarkTarget> targets;
  for (int k = 0; k < 12; ++k) {
    LandmarkTarget target;
    target.triangle = 95 * k + 20;
    target.barycentric = {0.5f, 0.2f, 0.3f};
    target.target_px = {64.0 + 50.0 * std::sin(2.0 * k), 56.0 + 50.0 * std::cos(3.0 * k)};
    target.sigma_px = 2.0 + k;
    targets.push_back(target);
  }
  return {targets, &sheet.topology, 128.0, 3.0};
}

TEST(LandmarkCost, KeepsTheContract) {
  Sheet sheet;
  const LandmarkCost cost = make_landmarks(sheet);
  const SynthesisObjective objective = sheet.objective({&cost});
  const std::vector<Eigen::VectorXd> points{sheet.x, sheet.offset(3.0, 1), sheet.offset(5.0, 2)};
  EXPECT_COST_CONTRACT(cost, sheet.topology, objective.space(), synthesis_of(objective), points,
                       {});
}

TEST(LandmarkCost, IsGemanMcClureOfTheDistanceInDeviations) {
  Sheet sheet;
  LandmarkTarget target;
  target.triangle = 600;
  target.barycentric = {0.0f, 1.0f, 0.0f};
  target.sigma_px = 4.0;
  const Eigen::Vector3d corner =
      sheet.mesh().positions_m.row(sheet.mesh().triangles(600, 1)).transpose();
  const Eigen::Vector2d seen = project_world(sheet.camera, corner + Eigen::Vector3d(0, 0, -0.25));
  target.target_px = 2.0 * seen + Eigen::Vector2d(6.0, -8.0);  // in an image of twice the size
  const LandmarkCost cost({target}, &sheet.topology, 128.0, 2.0);
  const SynthesisObjective objective = sheet.objective({&cost});
  const double s = 100.0 / 16.0;
  EXPECT_NEAR(objective.evaluate(sheet.x), 0.5 * s / (1.0 + s / 4.0), 1e-3);
}

TEST(PriorCost, KeepsTheContract) {
  Sheet sheet;
  const ParameterSpace& space = sheet.model.parameters();
  Eigen::VectorXd sigma = Eigen::VectorXd::Constant(space.tangent_size(), 0.02);
  sigma[4] = std::numeric_limits<double>::infinity();
  // Away from the mean by a rotation whose tangent is not that of the difference: small, because
  // the gradient takes the two for the same (first order in the angle).
  const PriorCost cost(sheet.offset(0.3, 5), sigma);
  const SynthesisObjective objective = sheet.objective({&cost});
  const std::vector<Eigen::VectorXd> points{sheet.x, sheet.offset(1.0, 1)};
  CostAccuracy accuracy;
  accuracy.gradient = 2e-3;
  EXPECT_COST_CONTRACT(cost, sheet.topology, space, synthesis_of(objective), points, accuracy);
}

TEST(PriorCost, TakesTheSpacesOwnPriors) {
  Sheet sheet;
  const PriorCost cost(sheet.model.parameters());
  Eigen::VectorXd x = sheet.x;
  x.tail<2>() << 0.02, -0.3;  // two and three deviations; the pose has no prior
  EXPECT_NEAR(sheet.objective({&cost}).evaluate(x), 0.5 * (4.0 + 9.0), 1e-9);
}

TEST(CostContract, FindsWrongGradientsAndNegativeCosts) {
  struct Wrong : Cost {
    double sign = 1.0, slope = 1.0;
    std::string name() const override { return "wrong"; }
    std::string unit() const override { return "1"; }
    double evaluate(const Synthesis& s, SurfaceEquations*, NormalEquations* direct) const override {
      const double d = s.x[7] - 1.0;
      if (direct != nullptr) direct->gradient[6] += slope * d, direct->hessian(6, 6) += 1.0;
      return 0.5 * sign * d * d;
    }
  };
  Sheet sheet;
  const SynthesisObjective objective = sheet.objective({});
  const std::vector<Eigen::VectorXd> points{sheet.x};
  const auto violations = [&](const Wrong& cost) {
    return cost_contract_violations(cost, sheet.topology, objective.space(),
                                    synthesis_of(objective), points, {});
  };
  Wrong cost;
  EXPECT_EQ(violations(cost), "");
  cost.slope = 1.1;
  EXPECT_THAT(violations(cost), ::testing::HasSubstr("differences give"));
  cost.slope = cost.sign = -1.0;
  EXPECT_THAT(violations(cost), ::testing::HasSubstr("the cost is -"));
}

}  // namespace
}  // namespace semblance
