#include "semblance/pipeline/clip_smoother.h"

#include <gmock/gmock.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "semblance/core/errors.h"
#include "semblance/core/random.h"
#include "semblance/core/rigid3.h"

namespace semblance {
namespace {

using ::testing::HasSubstr;
constexpr double infinity = std::numeric_limits<double>::infinity();

ParameterBlock euclidean_block(const std::string& name, int size, double bound) {
  ParameterBlock block;
  block.name = name;
  block.size = size;
  block.lower = Eigen::VectorXd::Constant(size, -bound);
  block.upper = Eigen::VectorXd::Constant(size, bound);
  block.prior_sigma = Eigen::VectorXd::Constant(size, 10.0);
  return block;
}

NormalEquations random_model(Random& random, Eigen::Index size) {
  Eigen::MatrixXd J(2 * size, size);
  for (Eigen::Index j = 0; j < size; ++j) J.col(j) = random.normal_vector(2 * size);
  const Eigen::VectorXd r = random.normal_vector(2 * size);
  return {J.transpose() * J, J.transpose() * r, 0.5 * r.squaredNorm()};
}

/// Frames with random points and models; the given ones are lost.
std::vector<ClipFrame> random_frames(const ParameterSpace& space, int count,
                                     const std::vector<int>& lost, unsigned seed) {
  Random random(seed);
  std::vector<ClipFrame> frames(count);
  for (int f = 0; f < count; ++f) {
    frames[f].x = space.plus(space.initial(), random.normal_vector(space.tangent_size()));
    frames[f].model = random_model(random, space.tangent_size());
    if (std::count(lost.begin(), lost.end(), f) > 0) frames[f] = {};
  }
  return frames;
}

/// Dense Hessian and gradient at 0 of the whole cost over absolute values, all frames one after
/// the other (the first `own` entries of each), then the shared entries: linear spaces only.
struct Dense {
  Eigen::MatrixXd hessian;
  Eigen::VectorXd gradient;

  Dense(const std::vector<ClipFrame>& frames, const Eigen::VectorXd& sigma, int own) {
    const int count = static_cast<int>(frames.size()), all = static_cast<int>(sigma.size());
    const int total = count * own + all - own;
    hessian = Eigen::MatrixXd::Zero(total, total);
    gradient = Eigen::VectorXd::Zero(total);
    for (int f = 0; f < count; ++f) {
      if (!frames[f].model) continue;
      Eigen::MatrixXd pick = Eigen::MatrixXd::Zero(all, total);
      for (int i = 0; i < all; ++i) pick(i, i < own ? f * own + i : count * own + i - own) = 1.0;
      const NormalEquations& model = *frames[f].model;
      hessian += pick.transpose() * model.hessian * pick;
      gradient += pick.transpose() * (model.gradient - model.hessian * frames[f].x);
    }
    for (int f = 0; f + 2 < count; ++f) {
      for (int i = 0; i < own; ++i) {
        Eigen::VectorXd row = Eigen::VectorXd::Zero(total);
        row[f * own + i] = row[(f + 2) * own + i] = 1.0 / sigma[i];
        row[(f + 1) * own + i] = -2.0 / sigma[i];
        hessian += row * row.transpose();
      }
    }
  }
};

TEST(ClipSmoother, EqualsTheDenseSolutionWithSharedEntriesAndABridgedGap) {
  const ParameterSpace space({euclidean_block("a", 2, 1e6), euclidean_block("shared", 2, 1e6)});
  const std::vector<ClipFrame> frames = random_frames(space, 9, {3, 4}, 1);
  ClipSmootherOptions options;
  options.acceleration_sigma = Eigen::Vector4d(0.3, 2.0, 1.0, 1.0);
  options.shared_blocks = {1};
  const SmoothedClip clip = smooth_clip(space, frames, options, silent_progress());
  ASSERT_TRUE(clip.converged);

  const Dense dense(frames, options.acceleration_sigma, 2);
  const Eigen::VectorXd solution = -dense.hessian.ldlt().solve(dense.gradient);
  const Eigen::VectorXd sigma = dense.hessian.inverse().diagonal().cwiseSqrt();
  for (int f = 0; f < 9; ++f) {
    const SmoothedFrame& frame = clip.frames[f];
    EXPECT_EQ(frame.state, f == 3 || f == 4 ? SmoothedState::bridged : SmoothedState::smoothed);
    EXPECT_LT((frame.x.head(2) - solution.segment(2 * f, 2)).norm(), 1e-5) << f;
    EXPECT_LT((frame.x.tail(2) - solution.tail(2)).norm(), 1e-5) << f;
    EXPECT_LT((frame.sigma.head(2) - sigma.segment(2 * f, 2)).norm(), 1e-5) << f;
    EXPECT_LT((frame.sigma.tail(2) - sigma.tail(2)).norm(), 1e-5) << f;
  }
  EXPECT_LT(clip.cost_after, clip.cost_before);
}

TEST(ClipSmoother, EqualsTheKalmanAndRauchTungStriebelSmoother) {
  const ParameterSpace space({euclidean_block("x", 1, 1e6)});
  constexpr int count = 60;
  constexpr double noise = 0.3, acceleration = 0.05;
  Random random(7);
  std::vector<ClipFrame> frames(count);
  for (int f = 0; f < count; ++f) {
    frames[f].x = Eigen::VectorXd::Constant(1, std::sin(0.1 * f) + noise * random.normal());
    frames[f].model = NormalEquations{Eigen::MatrixXd::Constant(1, 1, 1.0 / (noise * noise)),
                                      Eigen::VectorXd::Zero(1), 0.0};
  }
  ClipSmootherOptions options;
  options.acceleration_sigma = Eigen::VectorXd::Constant(1, acceleration);
  const SmoothedClip clip = smooth_clip(space, frames, options, silent_progress());

  // State (x, v): x moves by v, v by a random amount; nothing is known at the start.
  Eigen::Matrix2d transition, process = Eigen::Matrix2d::Zero();
  transition << 1, 1, 0, 1;
  process(1, 1) = acceleration * acceleration;
  std::vector<Eigen::Vector2d> mean(count), predicted_mean(count);
  std::vector<Eigen::Matrix2d> cov(count), predicted_cov(count);
  for (int f = 0; f < count; ++f) {
    predicted_mean[f] = f == 0 ? Eigen::Vector2d(0, 0) : Eigen::Vector2d(transition * mean[f - 1]);
    predicted_cov[f] =
        f == 0 ? Eigen::Matrix2d(1e6 * Eigen::Matrix2d::Identity())
               : Eigen::Matrix2d(transition * cov[f - 1] * transition.transpose() + process);
    const Eigen::Vector2d gain = predicted_cov[f].col(0) / (predicted_cov[f](0, 0) + noise * noise);
    mean[f] = predicted_mean[f] + gain * (frames[f].x[0] - predicted_mean[f][0]);
    cov[f] = predicted_cov[f] - gain * predicted_cov[f].row(0);
  }
  for (int f = count - 2; f >= 0; --f) {
    const Eigen::Matrix2d gain = cov[f] * transition.transpose() * predicted_cov[f + 1].inverse();
    mean[f] += gain * (mean[f + 1] - predicted_mean[f + 1]);
    cov[f] += gain * (cov[f + 1] - predicted_cov[f + 1]) * gain.transpose();
  }
  for (int f = 0; f < count; ++f) {
    EXPECT_NEAR(clip.frames[f].x[0], mean[f][0], 1e-5) << f;
    EXPECT_NEAR(clip.frames[f].sigma[0], std::sqrt(cov[f](0, 0)), 1e-5) << f;
  }
}

Eigen::Quaterniond quaternion(const Eigen::VectorXd& x) { return {x[0], x[1], x[2], x[3]}; }

/// A turning head observed with noise; the cost in its own words.
struct Turning {
  static constexpr double noise = 0.05, acceleration = 0.01;
  static constexpr int count = 25;
  ParameterSpace space{{rotation_block("rotation", "")}};
  std::vector<ClipFrame> frames{count};
  std::vector<Eigen::Quaterniond> truth;

  Turning() {
    Random random(3);
    const Eigen::Vector3d velocity(0.1, 0.25, -0.05);
    for (int f = 0; f < count; ++f) {
      truth.push_back(quaternion_from_rotation_vector(f * velocity) *
                      quaternion_from_rotation_vector({0.3, 0.2, 0.1}));
      const Eigen::Quaterniond seen =
          quaternion_from_rotation_vector(noise * random.normal_vector(3)) * truth.back();
      frames[f].x = Eigen::Vector4d(seen.w(), seen.x(), seen.y(), seen.z());
      frames[f].model = NormalEquations{Eigen::Matrix3d::Identity() / (noise * noise),
                                        Eigen::Vector3d::Zero(), 0.0};
    }
  }
  double cost(const std::vector<Eigen::Quaterniond>& q) const {
    double sum = 0.0;
    for (int f = 0; f < count; ++f) {
      const Eigen::AngleAxisd off(q[f] * quaternion(frames[f].x).conjugate());
      sum += 0.5 * std::pow(off.angle() / noise, 2);
      if (f + 2 >= count) continue;
      const Eigen::AngleAxisd a(q[f + 1] * q[f].conjugate()), b(q[f + 2] * q[f + 1].conjugate());
      sum += 0.5 * (b.angle() * b.axis() - a.angle() * a.axis()).squaredNorm() /
             (acceleration * acceleration);
    }
    return sum;
  }
};

TEST(ClipSmoother, FindsTheMinimumOverRotations) {
  const Turning turning;
  ClipSmootherOptions options;
  options.acceleration_sigma = Eigen::Vector3d::Constant(Turning::acceleration);
  const SmoothedClip clip = smooth_clip(turning.space, turning.frames, options, silent_progress());
  ASSERT_TRUE(clip.converged);
  std::vector<Eigen::Quaterniond> q, seen;
  double error = 0.0, error_before = 0.0;
  for (int f = 0; f < Turning::count; ++f) {
    q.push_back(quaternion(clip.frames[f].x));
    seen.push_back(quaternion(turning.frames[f].x));
    error += std::pow(q[f].angularDistance(turning.truth[f]), 2);
    error_before += std::pow(seen[f].angularDistance(turning.truth[f]), 2);
  }
  EXPECT_LT(error, 0.5 * error_before);
  const double cost = turning.cost(q);
  EXPECT_NEAR(clip.cost_after, cost, 1e-6 * cost);
  EXPECT_NEAR(clip.cost_before, turning.cost(seen), 1e-6 * clip.cost_before);
  constexpr double h = 1e-4;
  for (int f = 0; f < Turning::count; ++f) {
    for (int i = 0; i < 3; ++i) {
      std::vector<Eigen::Quaterniond> above = q, below = q;
      above[f] = quaternion_from_rotation_vector(h * Eigen::Vector3d::Unit(i)) * q[f];
      below[f] = quaternion_from_rotation_vector(-h * Eigen::Vector3d::Unit(i)) * q[f];
      const double curvature = (turning.cost(above) - 2.0 * cost + turning.cost(below)) / (h * h);
      const double step = (turning.cost(above) - turning.cost(below)) / (2.0 * h) / curvature;
      EXPECT_LT(std::abs(step), 1e-6) << f;
    }
  }
}

TEST(ClipSmoother, FindsTheMinimumWithinBounds) {
  constexpr int count = 12;
  const ParameterSpace space({euclidean_block("a", 2, 0.2), euclidean_block("shared", 1, 0.1)});
  std::vector<ClipFrame> frames = random_frames(space, count, {}, 5);
  ClipSmootherOptions options;
  options.acceleration_sigma = Eigen::Vector3d(0.5, 1.0, 1.0);
  options.shared_blocks = {1};
  const SmoothedClip clip = smooth_clip(space, frames, options, silent_progress());
  ASSERT_TRUE(clip.converged);

  const Dense dense(frames, options.acceleration_sigma, 2);
  Eigen::VectorXd bound = Eigen::VectorXd::Constant(2 * count + 1, 0.2);
  bound[2 * count] = 0.1;
  Eigen::VectorXd x = Eigen::VectorXd::Zero(2 * count + 1);
  const double length = 1.0 / dense.hessian.norm();
  for (int i = 0; i < 20000; ++i) {
    x = (x - length * (dense.hessian * x + dense.gradient)).cwiseMin(bound).cwiseMax(-bound);
  }
  int on_bounds = 0;
  for (int f = 0; f < count; ++f) {
    EXPECT_LT((clip.frames[f].x.head(2) - x.segment(2 * f, 2)).norm(), 1e-5) << f;
    EXPECT_NEAR(clip.frames[f].x[2], x[2 * count], 1e-5) << f;
    for (int i = 0; i < 2; ++i) on_bounds += std::abs(clip.frames[f].x[i]) > 0.2 - 1e-12 ? 1 : 0;
  }
  EXPECT_GT(on_bounds, 2);
}

TEST(ClipSmoother, CutsTheChainAtLongGapsAndLeavesThemLost) {
  const ParameterSpace space({euclidean_block("a", 2, 1e6)});
  const std::vector<ClipFrame> frames = random_frames(space, 16, {0, 6, 7, 8, 15}, 2);
  ClipSmootherOptions options;
  options.acceleration_sigma = Eigen::Vector2d(0.1, 0.1);
  options.longest_bridge = 2;
  const SmoothedClip whole = smooth_clip(space, frames, options, silent_progress());
  for (const int f : {0, 6, 7, 8, 15}) {
    EXPECT_EQ(whole.frames[f].state, SmoothedState::lost);
    EXPECT_EQ(whole.frames[f].x.size(), 0);
    EXPECT_EQ(whole.frames[f].sigma.size(), 0);
  }
  const std::vector<ClipFrame> second(frames.begin() + 9, frames.end());
  const SmoothedClip part = smooth_clip(space, second, options, silent_progress());
  for (int f = 9; f < 15; ++f) {
    EXPECT_LT((whole.frames[f].x - part.frames[f - 9].x).norm(), 1e-9);
    EXPECT_LT((whole.frames[f].sigma - part.frames[f - 9].sigma).norm(), 1e-9);
  }
  options.longest_bridge = 3;
  const SmoothedClip bridged = smooth_clip(space, frames, options, silent_progress());
  EXPECT_EQ(bridged.frames[7].state, SmoothedState::bridged);
  EXPECT_GT(bridged.frames[7].sigma[0], bridged.frames[5].sigma[0]);
  EXPECT_GT(bridged.frames[7].sigma[0], bridged.frames[9].sigma[0]);
}

TEST(ClipSmoother, SaysHowLittleIsKnownOfWhatNothingDetermines) {
  const ParameterSpace space({euclidean_block("a", 1, 1e6)});
  ClipFrame frame;
  frame.x = Eigen::VectorXd::Constant(1, 2.0);
  frame.model = NormalEquations{Eigen::MatrixXd::Zero(1, 1), Eigen::VectorXd::Zero(1), 1.0};
  ClipSmootherOptions options;
  options.acceleration_sigma = Eigen::VectorXd::Constant(1, 1.0);
  const SmoothedClip clip = smooth_clip(space, {frame}, options, silent_progress());
  EXPECT_DOUBLE_EQ(clip.frames[0].x[0], 2.0);
  EXPECT_NEAR(clip.frames[0].sigma[0], 1000.0 * 10.0, 1e-6);
}

TEST(ClipSmoother, IsEmptyWhenEveryFrameWasLost) {
  const ParameterSpace space({euclidean_block("a", 1, 1.0)});
  ClipSmootherOptions options;
  options.acceleration_sigma = Eigen::VectorXd::Constant(1, 1.0);
  const SmoothedClip clip =
      smooth_clip(space, std::vector<ClipFrame>(3), options, silent_progress());
  ASSERT_EQ(clip.frames.size(), 3u);
  EXPECT_EQ(clip.frames[1].state, SmoothedState::lost);
}

void expect_rejected(const ParameterSpace& space, const std::vector<ClipFrame>& frames,
                     const ClipSmootherOptions& options, const std::string& message) {
  try {
    smooth_clip(space, frames, options, silent_progress());
    ADD_FAILURE() << "accepted; expected: " << message;
  } catch (const InvalidInput& error) {
    EXPECT_THAT(error.what(), HasSubstr(message));
  }
}

TEST(ClipSmoother, RejectsWhatDoesNotFit) {
  const ParameterSpace space({euclidean_block("a", 1, 9.0), rotation_block("turn", "")});
  const std::vector<ClipFrame> frames = random_frames(space, 3, {}, 1);
  ClipSmootherOptions good;
  good.acceleration_sigma = Eigen::Vector4d::Ones();
  ClipSmootherOptions options = good;
  options.acceleration_sigma = Eigen::Vector3d::Ones();
  expect_rejected(space, frames, options, "expected 4");
  options.acceleration_sigma = Eigen::Vector4d(1, 1, 0, 1);
  expect_rejected(space, frames, options, "must be positive");
  options = good;
  options.shared_blocks = {1};
  expect_rejected(space, frames, options, "'turn' cannot be shared");
  options.shared_blocks = {2};
  expect_rejected(space, frames, options, "no block 2");
  std::vector<ClipFrame> broken = frames;
  broken[1].model->gradient[0] = infinity;
  expect_rejected(space, broken, good, "frame 1");
}

}  // namespace
}  // namespace semblance
