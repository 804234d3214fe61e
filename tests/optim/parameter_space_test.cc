#include "semblance/optim/parameter_space.h"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <limits>

#include "semblance/core/errors.h"
#include "semblance/core/random.h"
#include "semblance/core/rigid3.h"

namespace semblance {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double infinity = std::numeric_limits<double>::infinity();

ParameterSpace mixed_space() {
  return ParameterSpace({scalar_block("jaw_open", "1", 0.0, 1.0, 0.1, 0.2, ""),
                         rotation_block("rotation", ""), translation_block("translation", 5.0, ""),
                         scalar_block("gain", "1", -infinity, infinity, 1.0, infinity, "")});
}

Eigen::VectorXd random_point(const ParameterSpace& space, Random& random) {
  return space.plus(space.initial(), 0.5 * random.normal_vector(space.tangent_size()));
}

TEST(ParameterSpace, LaysBlocksOutInOrder) {
  const ParameterSpace space = mixed_space();
  EXPECT_EQ(space.size(), 9);
  EXPECT_EQ(space.tangent_size(), 8);
  const int translation = space.block_index("translation");
  EXPECT_EQ(space.offset(translation), 5);
  EXPECT_EQ(space.tangent_offset(translation), 4);
  EXPECT_THAT(space.entry_names(),
              ElementsAre("jaw_open", "rotation[0]", "rotation[1]", "rotation[2]", "rotation[3]",
                          "translation[0]", "translation[1]", "translation[2]", "gain"));
  EXPECT_THAT(space.entry_units(), ElementsAre("1", "1", "1", "1", "1", "m", "m", "m", "1"));
}

TEST(ParameterSpace, InitialIsThePriorMeanOrIdentityAndZero) {
  Eigen::VectorXd expected(9);
  expected << 0.1, 1, 0, 0, 0, 0, 0, 0, 1;
  EXPECT_EQ(mixed_space().initial(), expected);
}

TEST(ParameterSpace, ZeroStepIsTheIdentity) {
  const ParameterSpace space = mixed_space();
  Random random(1);
  const Eigen::VectorXd x = random_point(space, random);
  EXPECT_LT((space.plus(x, Eigen::VectorXd::Zero(8)) - x).norm(), 1e-15);
  EXPECT_LT(space.minus(x, x).norm(), 1e-15);
}

TEST(ParameterSpace, PlusAndMinusAreInverse) {
  const ParameterSpace space = mixed_space();
  Random random(2);
  for (int i = 0; i < 100; ++i) {
    const Eigen::VectorXd x = random_point(space, random), y = random_point(space, random);
    const Eigen::VectorXd d = space.minus(y, x);
    const Eigen::VectorXd back = space.plus(x, d);
    // q and -q are the same rotation.
    const double sign = back.segment<4>(1).dot(y.segment<4>(1)) < 0.0 ? -1.0 : 1.0;
    EXPECT_LT((sign * back.segment<4>(1) - y.segment<4>(1)).norm(), 1e-12);
    EXPECT_LT((back.head(1) - y.head(1)).norm() + (back.tail(4) - y.tail(4)).norm(), 1e-14);
    EXPECT_LT((space.minus(back, x) - d).norm(), 1e-12);
  }
}

TEST(ParameterSpace, RotationMovesFromTheLeft) {
  const ParameterSpace space({rotation_block("r", "")});
  const Eigen::Quaterniond q(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  const Eigen::Vector3d d(0.3, -0.2, 0.5);
  const Eigen::VectorXd moved = space.plus(Eigen::Vector4d(q.w(), q.x(), q.y(), q.z()), d);
  const Eigen::Matrix3d expected =
      Eigen::AngleAxisd(d.norm(), d.normalized()).toRotationMatrix() * q.toRotationMatrix();
  const Eigen::Quaterniond got(moved[0], moved[1], moved[2], moved[3]);
  EXPECT_LT((got.toRotationMatrix() - expected).norm(), 1e-14);
  EXPECT_NEAR(moved.norm(), 1.0, 1e-15);
}

TEST(ParameterSpace, StepsAreClampedToTheBounds) {
  const ParameterSpace space = mixed_space();
  const Eigen::VectorXd x = space.initial();
  EXPECT_EQ(space.plus(x, Eigen::VectorXd::Constant(8, 100.0))[0], 1.0);
  EXPECT_EQ(space.plus(x, Eigen::VectorXd::Constant(8, -100.0))[0], 0.0);
  EXPECT_EQ(space.plus(x, Eigen::VectorXd::Constant(8, -100.0))[5], -5.0);
  EXPECT_EQ(space.plus(x, Eigen::VectorXd::Constant(8, -100.0))[8], -99.0);
}

TEST(ParameterSpace, TangentBoundsReachTheBounds) {
  const ParameterSpace space = mixed_space();
  Eigen::VectorXd lower, upper;
  space.tangent_bounds(space.initial(), lower, upper);
  EXPECT_DOUBLE_EQ(lower[0], -0.1);
  EXPECT_DOUBLE_EQ(upper[0], 0.9);
  EXPECT_DOUBLE_EQ(upper[2], 3.14159265358979323846);
  EXPECT_EQ(upper[7], infinity);
}

TEST(ParameterSpace, TangentScaleIsSigmaOrATenthOfTheRangeOrATenth) {
  Eigen::VectorXd expected(8);
  expected << 0.2, 0.1, 0.1, 0.1, 1.0, 1.0, 1.0, 0.1;
  EXPECT_LT((mixed_space().tangent_scale() - expected).norm(), 1e-15);
}

void expect_rejected(ParameterBlock block, const std::string& message) {
  try {
    ParameterSpace({std::move(block)});
    ADD_FAILURE() << "accepted; expected: " << message;
  } catch (const InvalidInput& error) {
    EXPECT_THAT(error.what(), HasSubstr(message));
  }
}

TEST(ParameterSpace, RejectsBlocksThatMakeNoSense) {
  const ParameterBlock good = scalar_block("a", "1", 0, 1, 0.5, 1, "");
  ParameterBlock block = good;
  block.lower[0] = 2.0;
  expect_rejected(block, "lower bound must be at most");
  block = good;
  block.upper[0] = std::numeric_limits<double>::quiet_NaN();
  expect_rejected(block, "lower bound must be at most");
  block = good;
  block.prior_mean[0] = 2.0;
  expect_rejected(block, "within the bounds");
  block = good;
  block.prior_sigma[0] = 0.0;
  expect_rejected(block, "sigma must be positive");
  block = good;
  block.size = 2;
  expect_rejected(block, "expected 2");
  block = rotation_block("r", "");
  block.size = 3;
  expect_rejected(block, "a rotation has size 4");
  block = rotation_block("r", "");
  block.prior_mean = Eigen::Vector4d(2, 0, 0, 0);
  expect_rejected(block, "unit quaternion");
  EXPECT_THROW(ParameterSpace({good, good}), InvalidInput);
}

TEST(ParameterSpace, UnknownNamesListTheKnownOnes) {
  try {
    mixed_space().block_index("nose");
    FAIL();
  } catch (const InvalidInput& error) {
    EXPECT_THAT(error.what(), HasSubstr("jaw_open, rotation, translation, gain"));
  }
}

TEST(ParameterSpace, WrongLengthsAreRejected) {
  const ParameterSpace space = mixed_space();
  EXPECT_THROW(space.plus(Eigen::VectorXd::Zero(3), Eigen::VectorXd::Zero(8)), InvalidInput);
  EXPECT_THROW(space.plus(space.initial(), Eigen::VectorXd::Zero(9)), InvalidInput);
  EXPECT_THROW(space.minus(space.initial(), Eigen::VectorXd::Zero(3)), InvalidInput);
}

}  // namespace
}  // namespace semblance
