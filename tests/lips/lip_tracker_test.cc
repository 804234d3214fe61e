#include "semblance/lips/lip_tracker.h"

#include <gtest/gtest.h>

#include <sstream>

#include "painted_mouth.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Vector2d;
using testing::DotPaint;

constexpr int kWidth = 240, kHeight = 180;

/// Speaking, drifting and tilting.
std::vector<Vector2d> mouth_at(int frame, int count) {
  const double s = frame / 25.0;
  auto shape = testing::mouth_shape(0.5 + 0.5 * std::sin(9.0 * s));
  shape.resize(static_cast<std::size_t>(count));
  return testing::place_mouth(shape, {115 + 18 * std::sin(2 * s), 82 + 9 * std::sin(3 * s)}, 58,
                              0.15 * std::sin(2.5 * s));
}

/// Without the dots that `hidden` names.
Image picture_at(int frame, int count, const std::vector<int>& hidden, const DotPaint& paint = {}) {
  std::vector<Vector2d> places;
  const auto all = mouth_at(frame, count);
  for (int i = 0; i < count; ++i) {
    if (std::find(hidden.begin(), hidden.end(), i) == hidden.end()) places.push_back(all[i]);
  }
  return testing::paint_dots(kWidth, kHeight, places, paint, 100 + frame);
}

std::vector<int> everything(int count) {
  std::vector<int> all;
  for (int i = 0; i < count; ++i) all.push_back(i);
  return all;
}

/// Hides the left half for some frames and everything for some later ones.
std::vector<int> hidden_at(int frame, int count) {
  if (frame >= 18 && frame < 24) return {};
  if (frame >= 8 && frame < 14) {
    return count == 16 ? std::vector<int>{0, 1, 7, 8, 9, 15} : std::vector<int>{0, 1, 7};
  }
  return frame >= 24 && frame < 29 ? everything(count) : std::vector<int>{};
}

TEST(LipTracker, KeepsIdentitiesThroughOcclusions) {
  for (const int count : {16, 8}) {
    LipTracker tracker(count);
    for (int frame = 0; frame < 36; ++frame) {
      const auto hidden = hidden_at(frame, count);
      const LipEstimate found =
          tracker.follow(frame, frame / 25.0, picture_at(frame, count, hidden));
      const auto real = mouth_at(frame, count);
      const bool all_hidden = static_cast<int>(hidden.size()) == count;
      EXPECT_EQ(found.status == TrackStatus::lost, all_hidden) << "frame " << frame;
      EXPECT_EQ(found.status == TrackStatus::reinitialised, frame == 29) << "frame " << frame;
      for (int i = 0; i < count; ++i) {
        const TrackedMarker& m = found.markers[static_cast<std::size_t>(i)];
        const bool shown = std::find(hidden.begin(), hidden.end(), i) == hidden.end();
        EXPECT_EQ(m.marker.state == MarkerState::seen, shown) << frame << " marker " << i;
        if (!shown || !m.known()) continue;
        EXPECT_LT((m.marker.position_px - real[static_cast<std::size_t>(i)]).norm(), 0.3)
            << "frame " << frame << " marker " << i;
      }
    }
  }
}

TEST(LipTracker, WithoutDotsThereIsNothing) {
  LipTracker tracker(16);
  for (int frame = 0; frame < 3; ++frame) {
    const LipEstimate found = tracker.follow(frame, 0.0, picture_at(frame, 16, everything(16)));
    EXPECT_EQ(found.status, TrackStatus::lost);
    EXPECT_EQ(found.confidence, 0.0);
    for (const TrackedMarker& m : found.markers) EXPECT_FALSE(m.known());
  }
  EXPECT_FALSE(tracker.has_markers());
}

TEST(LipTracker, WaitsForAPictureOfAllDots) {
  LipTracker tracker(16);
  EXPECT_EQ(tracker.follow(0, 0.0, picture_at(0, 16, {3})).status, TrackStatus::lost);
  EXPECT_EQ(tracker.follow(1, 0.04, picture_at(1, 16, {})).status, TrackStatus::tracked);
}

TEST(LipTracker, AnotherPaintIsLearnedAfterALongLoss) {
  LipTracker tracker(16);
  DotPaint white;
  white.colour = {0.9f, 0.9f, 0.9f};
  EXPECT_EQ(tracker.follow(0, 0.0, picture_at(0, 16, {})).status, TrackStatus::tracked);
  int frame = 1;
  while (frame < 40 &&
         tracker.follow(frame, frame / 25.0, picture_at(frame, 16, {}, white)).status ==
             TrackStatus::lost) {
    ++frame;
  }
  EXPECT_GT(frame, 10);
  EXPECT_LT(frame, 40);
}

TEST(LipTracker, RestoredStateGoesOnToTheSameBits) {
  LipTracker whole(16), first(16), second(16);
  for (int frame = 0; frame < 12; ++frame) {
    const Image picture = picture_at(frame, 16, hidden_at(frame, 16));
    const LipEstimate expected = whole.follow(frame, frame / 25.0, picture);
    if (frame < 9) first.follow(frame, frame / 25.0, picture);
    if (frame == 8) {
      std::stringstream state;
      first.save_state(state);
      second.restore_state(state, "state");
    }
    if (frame < 9) continue;
    const LipEstimate found = second.follow(frame, frame / 25.0, picture);
    EXPECT_EQ(to_track_frame(found).extra.dump(), to_track_frame(expected).extra.dump());
  }
  std::stringstream state;
  whole.save_state(state);
  LipTracker eight(8);
  EXPECT_THROW(eight.restore_state(state, "state"), InvalidInput);
}

}  // namespace
}  // namespace semblance
