#include "semblance/lips/complete_track.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "painted_mouth.h"
#include "semblance/core/errors.h"
#include "support.h"

namespace semblance {
namespace {

using Eigen::Vector2d;

constexpr double kRate = 25.0;

LipEstimate seen_at(int frame, const std::vector<Vector2d>& places) {
  LipEstimate estimate;
  estimate.frame = frame;
  estimate.time_s = frame / kRate;
  estimate.status = TrackStatus::tracked;
  estimate.confidence = 1.0;
  for (const Vector2d& p : places) {
    TrackedMarker m;
    m.marker.state = MarkerState::seen;
    m.marker.position_px = p;
    m.sigma_px.setConstant(0.1);
    estimate.markers.push_back(m);
  }
  return estimate;
}

/// A mouth that moves, turns and opens; all of it an affine motion of the plane.
std::vector<Vector2d> mouth_at(double time_s) {
  auto shape = testing::mouth_shape(0.2);
  for (Vector2d& p : shape) p.y() *= 1.0 + 0.5 * std::sin(6.0 * time_s);
  return testing::place_mouth(shape, {300 + 40 * time_s, 200 - 25 * time_s}, 60,
                              0.2 * std::sin(3 * time_s));
}

std::vector<LipEstimate> clip(int frames) {
  std::vector<LipEstimate> track;
  for (int t = 0; t < frames; ++t) track.push_back(seen_at(t, mouth_at(t / kRate)));
  return track;
}

void hide(std::vector<LipEstimate>& track, int from, int to, std::size_t marker) {
  for (int t = from; t < to; ++t) track[static_cast<std::size_t>(t)].markers[marker] = {};
}

TEST(BridgeGaps, FollowsWhatTheOthersDo) {
  auto track = clip(60);
  hide(track, 20, 30, 5);
  hide(track, 20, 30, 13);
  bridge_gaps(track);
  for (std::size_t t = 20; t < 30; ++t) {
    for (const std::size_t i : {5u, 13u}) {
      const TrackedMarker& m = track[t].markers[i];
      ASSERT_EQ(m.marker.state, MarkerState::bridged);
      EXPECT_LT((m.marker.position_px - mouth_at(t / kRate)[i]).norm(), 1e-9);
      EXPECT_LT(m.sigma_px.norm(), 1e-6);  // the rule is exact wherever it can be tried
    }
  }
}

TEST(BridgeGaps, StatesItsErrorWhereTheOthersDoNotKnow) {
  // Marker 6 wanders by itself as well; its deviation must be about the error of the rule.
  auto track = clip(1600);
  Random random(4);
  Vector2d wander = Vector2d::Zero();
  std::vector<Vector2d> real;
  for (LipEstimate& estimate : track) {
    wander = 0.9 * wander + Vector2d(random.normal(), random.normal());
    estimate.markers[6].marker.position_px += wander;
    real.push_back(estimate.markers[6].marker.position_px);
  }
  int within = 0, count = 0;
  for (int begin = 20; begin + 30 < 1600; begin += 23) {
    auto hidden = track;
    hide(hidden, begin, begin + 7, 6);
    bridge_gaps(hidden);
    for (int t = begin; t < begin + 7; ++t) {
      const TrackedMarker& m = hidden[static_cast<std::size_t>(t)].markers[6];
      const Vector2d error = m.marker.position_px - real[static_cast<std::size_t>(t)];
      for (int axis = 0; axis < 2; ++axis) {
        within += std::abs(error[axis]) < m.sigma_px[axis] ? 1 : 0;
        ++count;
      }
    }
  }
  EXPECT_NEAR(within / static_cast<double>(count), 0.683, 0.1);
}

TEST(BridgeGaps, StatesMoreWhereTheMouthIsLivelier) {
  // Every marker wanders by itself, six times as far in every other four seconds.
  constexpr int kFrames = 3000, kHidden = 7;
  const auto is_lively = [](int frame) { return frame / 100 % 2 == 1; };
  auto track = clip(kFrames);
  Random random(9);
  std::vector<Vector2d> wander(16, Vector2d::Zero());
  for (LipEstimate& estimate : track) {
    const double reach_px = is_lively(estimate.frame) ? 3.0 : 0.5;
    for (std::size_t i = 0; i < wander.size(); ++i) {
      wander[i] = 0.9 * wander[i] + reach_px * Vector2d(random.normal(), random.normal());
      estimate.markers[i].marker.position_px += wander[i];
    }
  }
  std::array<int, 2> within{}, count{};
  for (int begin = 40; begin + 50 < kFrames; begin += 50) {
    auto hidden = track;
    hide(hidden, begin, begin + kHidden, 6);
    bridge_gaps(hidden);
    for (int t = begin; t < begin + kHidden; ++t) {
      const auto row = static_cast<std::size_t>(t);
      const TrackedMarker& m = hidden[row].markers[6];
      const Vector2d error = m.marker.position_px - track[row].markers[6].marker.position_px;
      for (int axis = 0; axis < 2; ++axis) {
        within[is_lively(t)] += std::abs(error[axis]) < m.sigma_px[axis] ? 1 : 0;
        ++count[is_lively(t)];
      }
    }
  }
  for (const int lively : {0, 1}) {
    EXPECT_NEAR(within[lively] / static_cast<double>(count[lively]), 0.683, 0.1) << lively;
  }
}

TEST(BridgeGaps, DoesNotInvent) {
  auto track = clip(80);
  hide(track, 0, 5, 2);    // before it was ever seen
  hide(track, 70, 80, 3);  // after it was last seen
  hide(track, 20, 40, 4);  // for longer than is bridged
  for (int t = 50; t < 53; ++t) {
    auto& estimate = track[static_cast<std::size_t>(t)];
    estimate.status = TrackStatus::lost;
    estimate.markers.assign(16, {});
  }
  bridge_gaps(track);
  for (const LipEstimate& estimate : track) {
    for (const TrackedMarker& m : estimate.markers) {
      EXPECT_NE(m.marker.state, MarkerState::bridged) << "frame " << estimate.frame;
    }
  }
}

TEST(BridgeGaps, ASecondTimeChangesNothing) {
  auto track = clip(40);
  hide(track, 10, 14, 1);
  bridge_gaps(track);
  auto again = track;
  bridge_gaps(again);
  for (std::size_t t = 0; t < track.size(); ++t) {
    EXPECT_EQ(again[t].markers[1].marker.position_px, track[t].markers[1].marker.position_px);
    EXPECT_EQ(again[t].markers[1].marker.state, track[t].markers[1].marker.state);
  }
}

TEST(Velocities, CentralOnesAreExactForParabolasAndOneSidedOnesForLines) {
  const Vector2d v(120, -45), a(300, 800);
  for (const int neighbours : {1, 3}) {
    std::vector<LipEstimate> line, parabola;
    for (int t = 0; t < 12; ++t) {
      const double s = t / kRate;
      line.push_back(seen_at(t, std::vector<Vector2d>(8, v * s)));
      parabola.push_back(seen_at(t, std::vector<Vector2d>(8, v * s + 0.5 * a * s * s)));
    }
    hide(line, 7, 8, 0);
    add_velocities(line, neighbours);
    add_velocities(parabola, neighbours);
    for (const int t : {0, 5, 6, 8, 11}) {
      EXPECT_LT((line[t].markers[0].marker.velocity_px_s - v).norm(), 1e-9) << t;
    }
    for (int t = neighbours; t < 12 - neighbours; ++t) {
      EXPECT_LT((parabola[t].markers[1].marker.velocity_px_s - v - a * (t / kRate)).norm(), 1e-9);
    }
    EXPECT_GT((parabola[0].markers[1].marker.velocity_px_s - v).norm(), 1.0);
  }
}

TEST(Velocities, ALoneMarkerHasNone) {
  auto track = clip(9);
  hide(track, 0, 4, 7);
  hide(track, 5, 9, 7);
  add_velocities(track, 2);
  EXPECT_EQ(track[4].markers[7].marker.velocity_px_s, Vector2d::Zero());
}

TEST(LipEstimates, SurviveATrackFile) {
  const testing::TemporaryFolder folder;
  auto track = clip(12);
  hide(track, 4, 7, 9);
  track[9].status = TrackStatus::lost;
  track[9].markers.assign(16, {});
  track[9].confidence = 0.0;
  bridge_gaps(track);
  add_velocities(track, 1);
  const std::string path = (folder.path() / "track.jsonl").string();
  TrackHeader header;
  header.kind = "lips";
  {
    TrackWriter writer(path, header);
    for (const LipEstimate& estimate : track) writer.write(to_track_frame(estimate));
  }
  const Track read = read_track(path);
  ASSERT_EQ(read.frames.size(), track.size());
  for (std::size_t t = 0; t < track.size(); ++t) {
    const LipEstimate back = from_track_frame(read.frames[t], 16, path);
    EXPECT_EQ(back.status, track[t].status);
    EXPECT_EQ(back.confidence, track[t].confidence);
    for (std::size_t i = 0; i < 16; ++i) {
      const TrackedMarker &a = back.markers[i], &b = track[t].markers[i];
      EXPECT_EQ(a.marker.state, b.marker.state);
      EXPECT_EQ(a.marker.position_px, b.marker.position_px);
      EXPECT_EQ(a.marker.velocity_px_s, b.marker.velocity_px_s);
      if (b.known()) {
        EXPECT_TRUE(a.sigma_px == b.sigma_px || b.sigma_px.minCoeff() < 0.0);
      }
    }
  }
  EXPECT_THROW(from_track_frame(read.frames[0], 8, path), InvalidInput);
}

TEST(MouthOpening, IsTheInnerContoursHeightOverItsWidth) {
  LipEstimate estimate = seen_at(0, mouth_at(0.0));
  const auto& m = estimate.markers;
  EXPECT_NEAR(mouth_opening(estimate),
              (m[10].marker.position_px - m[14].marker.position_px).norm() /
                  (m[8].marker.position_px - m[12].marker.position_px).norm(),
              1e-12);
  estimate.markers[10] = {};
  EXPECT_TRUE(std::isnan(mouth_opening(estimate)));
}

}  // namespace
}  // namespace semblance
