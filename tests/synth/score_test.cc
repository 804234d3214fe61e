#include "semblance/synth/score.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "semblance/core/camera.h"
#include "semblance/core/errors.h"
#include "semblance/core/random.h"
#include "semblance/core/rigid3.h"

namespace semblance {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;
const Camera kCamera = Camera::centred(640, 480, 600);

Quaterniond turn_deg(double x, double y, double z) {
  return quaternion_from_rotation_vector(kDegree * Vector3d(x, y, z));
}

nlohmann::json header() {
  const Quaterniond& q = kCamera.camera_from_world.rotation;
  return {{"cameras",
           {{{"focal_px", {600.0, 600.0}},
             {"camera_from_world",
              {{"rotation_wxyz", {q.w(), q.x(), q.y(), q.z()}}, {"translation_m", {0, 0, 0}}}}}}},
          {"parameters", nlohmann::json::array()}};
}

// Places on a head, outer eye corners 9 cm apart.
std::vector<Vector3d> head_points() {
  Random random(3);
  std::vector<Vector3d> points;
  for (int i = 0; i < 68; ++i)
    points.emplace_back(random.uniform(-.07, .07), random.uniform(-.1, .05),
                        random.uniform(-.06, .02));
  points[36] = {-0.045, 0, 0};
  points[45] = {0.045, 0, 0};
  return points;
}

TrackFrame frame_at(int number, const Quaterniond& turn, const Vector3d& place,
                    const std::vector<Vector3d>& points) {
  TrackFrame frame;
  frame.frame = number;
  frame.time_s = number / 25.0;
  frame.status = TrackStatus::tracked;
  frame.rotation_wxyz = {turn.w(), turn.x(), turn.y(), turn.z()};
  frame.translation_m = place;
  frame.x.resize(7);
  frame.x << frame.rotation_wxyz, place;
  for (const Vector3d& point : points)
    frame.landmarks_px.push_back(project_world(kCamera, turn * point + place));
  return frame;
}

Quaterniond true_turn(int i) {
  return turn_deg(10 * std::sin(i * .3), 35 * std::sin(i * .21), 6 * std::cos(i * .4));
}
Vector3d true_place(int i) {
  return {0.02 * std::sin(i * .5), 0.01 * std::cos(i * .3), -0.6 + 0.05 * std::sin(i * .17)};
}

ScoredClip perfect_clip(int frames) {
  ScoredClip clip;
  clip.name = "hand-made";
  clip.truth.header = clip.track.header = header();
  for (int i = 0; i < frames; ++i)
    clip.truth.frames.push_back(frame_at(i, true_turn(i), true_place(i), head_points()));
  clip.track.frames = clip.truth.frames;
  return clip;
}

TEST(ScoreTest, PerfectTrackScoresZero) {
  const SuiteScore score = score_tracks({perfect_clip(40)});
  EXPECT_EQ(score.overall.frames, 40);
  EXPECT_EQ(score.overall.tracked, 40);
  EXPECT_EQ(score.overall.lost, 0);
  EXPECT_EQ(score.overall.unflagged, 0);
  EXPECT_NEAR(score.overall.rotation_absolute_deg.p95, 0, 1e-6);
  EXPECT_NEAR(score.overall.translation_per_clip_percent.p95, 0, 1e-6);
  EXPECT_NEAR(score.overall.landmarks_absolute_percent.all_68.p95, 0, 1e-9);
}

TEST(ScoreTest, ConstantModelDifferenceIsAbsoluteErrorButNotAligned) {
  ScoredClip clip = perfect_clip(60);
  const Quaterniond frame_turn = turn_deg(3, -4, 0);  // 5 degrees in all
  const Vector3d origin(0.002, -0.003, 0.006);        // 7 mm
  const Vector3d moved(0.0, 0.0045, 0.0);             // of every landmark, on the head
  auto points = head_points();
  for (Vector3d& point : points) point += moved;
  for (int i = 0; i < 60; ++i) {
    TrackFrame& frame = clip.track.frames[i];
    frame = frame_at(i, true_turn(i), true_place(i), points);
    const Quaterniond q = true_turn(i) * frame_turn;
    frame.rotation_wxyz = {q.w(), q.x(), q.y(), q.z()};
    frame.translation_m = true_place(i) + true_turn(i) * origin;
  }
  const SuiteScore score = score_tracks({clip});
  EXPECT_NEAR(score.overall.rotation_absolute_deg.median, 5.0, 1e-3);
  EXPECT_NEAR(score.overall.rotation_absolute_deg.p95, 5.0, 1e-3);
  EXPECT_NEAR(score.overall.rotation_aligned_deg.p95, 0.0, 1e-3);
  EXPECT_NEAR((score.origin_offset_m - origin).norm(), 0.0, 1e-9);
  EXPECT_NEAR(score.overall.translation_absolute_percent.median, 100 * 0.007 / 0.6, 0.1);
  EXPECT_NEAR(score.overall.translation_aligned_percent.p95, 0.0, 1e-6);
  // 4.5 of 90 mm is 5 % where the head faces the camera; turned, the eyes come closer together.
  EXPECT_GT(score.overall.landmarks_absolute_percent.all_68.median, 4.5);
  EXPECT_LT(score.overall.landmarks_absolute_percent.all_68.median, 6.5);
  // What is left is perspective: the offset is taken at the head's depth, not at each point's.
  EXPECT_LT(score.overall.landmarks_aligned_percent.all_68.p95, 0.6);
}

TEST(ScoreTest, ConstantsAreOfTheSuiteNotOfTheClip) {
  ScoredClip left = perfect_clip(40), middle = perfect_clip(40), right = perfect_clip(40);
  const auto bend = [](ScoredClip& clip, double yaw_deg) {
    for (TrackFrame& frame : clip.track.frames) {
      const Quaterniond q = Quaterniond(frame.rotation_wxyz[0], frame.rotation_wxyz[1],
                                        frame.rotation_wxyz[2], frame.rotation_wxyz[3]) *
                            turn_deg(0, yaw_deg, 0);
      frame.rotation_wxyz = {q.w(), q.x(), q.y(), q.z()};
    }
  };
  bend(left, -2), bend(right, 4);
  const SuiteScore score = score_tracks({left, middle, right});
  // The L1 mean of -2, 0, 4 degrees is 0: what the clips differ by remains.
  EXPECT_NEAR(score.clips[0].rotation_aligned_deg.median, 2.0, 1e-2);
  EXPECT_NEAR(score.clips[2].rotation_aligned_deg.median, 4.0, 1e-2);
  EXPECT_NEAR(score.clips[2].rotation_per_clip_deg.median, 0.0, 1e-3);
}

TEST(ScoreTest, LargerFartherHeadIsOnlyAScale) {
  ScoredClip clip = perfect_clip(40);
  for (TrackFrame& frame : clip.track.frames) frame.translation_m *= 1.04;
  const SuiteScore score = score_tracks({clip});
  EXPECT_NEAR(score.overall.translation_absolute_percent.median, 4.0, 1e-6);
  EXPECT_LT(score.overall.translation_per_clip_percent.p95, 0.01);
}

TEST(ScoreTest, LostFramesAndUnflaggedOnesAreCounted) {
  ScoredClip clip = perfect_clip(30);
  clip.track.frames[3].status = TrackStatus::lost;
  clip.track.frames.erase(clip.track.frames.begin() + 20);  // missing counts as lost
  const Quaterniond wrong = true_turn(7) * turn_deg(0, 12, 0);
  clip.track.frames[7].rotation_wxyz = {wrong.w(), wrong.x(), wrong.y(), wrong.z()};
  for (Vector2d& p : clip.track.frames[9].landmarks_px) p.x() += 20;  // over 15 % of about 90 px
  const Quaterniond fair = true_turn(11) * turn_deg(0, 8, 0);
  clip.track.frames[11].rotation_wxyz = {fair.w(), fair.x(), fair.y(), fair.z()};
  clip.truth.frames[15].extra = {{"in_picture", false}};  // absent, and tracked well: no fault
  clip.truth.frames[16].extra = {{"in_picture", false}};
  for (Vector2d& p : clip.track.frames[16].landmarks_px) p.x() += 40;  // absent, and nonsense
  const ClipScore score = score_tracks({clip}).overall;
  EXPECT_EQ(score.frames, 28);
  EXPECT_EQ(score.absent, 2);
  EXPECT_EQ(score.lost, 2);
  EXPECT_EQ(score.tracked, 26);
  EXPECT_EQ(score.unflagged, 3);
}

TEST(ScoreTest, JitterIsTheDeviationOfWhiteNoiseInStillStretches) {
  ScoredClip clip;
  clip.name = "still";
  clip.truth.header = clip.track.header = header();
  Random random(8);
  constexpr double kSigmaDeg = 0.2, kSigmaM = 0.0005;
  for (int i = 0; i < 2000; ++i) {
    const Quaterniond turn = turn_deg(1, 2, 3);
    const Vector3d place(0.01, 0, -0.6);
    clip.truth.frames.push_back(frame_at(i, turn, place, head_points()));
    const Quaterniond shaken = turn * turn_deg(0, kSigmaDeg * random.normal(), 0);
    clip.track.frames.push_back(
        frame_at(i, shaken, place + Vector3d(kSigmaM * random.normal(), 0, 0), head_points()));
  }
  const ClipScore score = score_tracks({clip}).overall;
  EXPECT_EQ(score.still_pairs, 1999);
  EXPECT_NEAR(score.rotation_jitter_deg, kSigmaDeg, 0.015);
  EXPECT_NEAR(score.translation_jitter_mm, 1000 * kSigmaM, 0.04);
}

TEST(ScoreTest, CoverageOfHonestSigmas) {
  ScoredClip clip = perfect_clip(1500);
  Random random(4);
  constexpr double kSigmaM = 0.002;
  for (TrackFrame& frame : clip.track.frames) {
    for (int k = 0; k < 3; ++k) frame.translation_m[k] += kSigmaM * random.normal();
    frame.x.tail<3>() = frame.translation_m;
    frame.sigma = Eigen::VectorXd::Constant(7, std::nan(""));
    frame.sigma.tail<3>().setConstant(kSigmaM);
  }
  const ClipScore score = score_tracks({clip}).overall;
  EXPECT_EQ(score.translation_coverage.count, 4500);
  EXPECT_NEAR(score.translation_coverage.one_sigma, 0.683, 0.02);
  EXPECT_NEAR(score.translation_coverage.two_sigma, 0.954, 0.01);
  EXPECT_EQ(score.rotation_coverage.count, 0);
  EXPECT_TRUE(std::isnan(score.rotation_coverage.one_sigma));
}

TEST(ScoreTest, JsonIsValidAndKeepsMissingFiguresNull) {
  ScoredClip clip = perfect_clip(5);
  for (TrackFrame& frame : clip.track.frames) frame.status = TrackStatus::lost;
  const SuiteScore score = score_tracks({clip});
  const auto json = nlohmann::json::parse(score_json(score));
  EXPECT_EQ(json["overall"]["lost"], 5);
  EXPECT_TRUE(json["overall"]["rotation_deg"]["absolute"]["median"].is_null());
  EXPECT_NE(score_table(score).find("hand-made"), std::string::npos);
}

TEST(ScoreTest, TruthWithoutLandmarksIsRefused) {
  ScoredClip clip = perfect_clip(2);
  clip.truth.frames[1].landmarks_px.clear();
  EXPECT_THROW(score_tracks({clip}), InvalidInput);
}

}  // namespace
}  // namespace semblance
