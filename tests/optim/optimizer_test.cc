#include "semblance/optim/optimizer.h"

#include <gmock/gmock.h>

#include <functional>

#include "semblance/core/errors.h"
#include "semblance/optim/contract.h"

namespace semblance {
namespace {

struct Case {
  const char* name;
  OptimizerAccuracy accuracy;
};

std::ostream& operator<<(std::ostream& out, const Case& item) { return out << item.name; }

class EveryOptimizer : public ::testing::TestWithParam<Case> {};

TEST_P(EveryOptimizer, KeepsTheContract) {
  const std::string name = GetParam().name;
  const auto make = [&](const OptimizerOptions& options) { return make_optimizer(name, options); };
  EXPECT_EQ(make({})->name(), name);
  EXPECT_OPTIMIZER_CONTRACT(make, GetParam().accuracy);
}

INSTANTIATE_TEST_SUITE_P(Table, EveryOptimizer,
                         ::testing::Values(Case{"lm", {0, 1e-7, 1e-6, 1e-6}},
                                           Case{"ceres", {0, 1e-7, 1e-6, 1e-6}},
                                           Case{"anneal", {20000, 1e-3, 1e-2, 1e-3}},
                                           Case{"interacting", {20000, 1e-3, 1e-2, 1e-3}},
                                           Case{"particle", {20000, 1e-3, 1e-2, 1e-3}},
                                           Case{"pso", {20000, 1e-4, 1e-3, 1e-4}},
                                           Case{"cmaes", {20000, 1e-5, 1e-5, 1e-5}}),
                         [](const auto& tested) { return std::string(tested.param.name); });

/// Does its work with another optimizer, then spoils the outcome.
class Spoilt final : public Optimizer {
 public:
  Spoilt(std::unique_ptr<Optimizer> inner, std::function<void(Solution&)> spoil)
      : inner_(std::move(inner)), spoil_(std::move(spoil)) {}
  std::string name() const override { return "spoilt"; }
  Solution minimize(const Objective& objective, const Eigen::VectorXd& x0,
                    Progress& progress) const override {
    Solution solution = inner_->minimize(objective, x0, progress);
    spoil_(solution);
    return solution;
  }

 private:
  std::unique_ptr<Optimizer> inner_;
  std::function<void(Solution&)> spoil_;
};

std::string violations_when(const std::function<void(Solution&)>& spoil) {
  return optimizer_contract_violations(
      [&](const OptimizerOptions& options) {
        return std::make_unique<Spoilt>(make_optimizer("lm", options), spoil);
      },
      {});
}

TEST(OptimizerContract, FindsBrokenPromises) {
  EXPECT_EQ(violations_when([](Solution&) {}), "");
  EXPECT_THAT(violations_when([](Solution& solution) { solution.evaluations += 1; }),
              ::testing::HasSubstr("evaluations, made"));
  EXPECT_THAT(violations_when([](Solution& solution) { solution.x.array() += 10.0; }),
              ::testing::HasSubstr("out of its bounds"));
  EXPECT_THAT(violations_when([](Solution& solution) { solution.cost += 100.0; }),
              ::testing::HasSubstr("above the start"));
}

TEST(OptimizerTable, NamesThemAll) {
  EXPECT_THAT(optimizer_names(), ::testing::ElementsAre("lm", "ceres", "anneal", "interacting",
                                                        "particle", "pso", "cmaes"));
  try {
    make_optimizer("newton", {});
    FAIL();
  } catch (const InvalidInput& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("lm, ceres, anneal"));
  }
}

}  // namespace
}  // namespace semblance
