// A mouth of 16 markers that speaks, in closed form.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <vector>

#include "semblance/io/lip_markers.h"

namespace semblance::testing {

struct TalkingMouth {
  Eigen::Vector2d middle_px{160.0, 150.0};
  double width_px = 60.0;
  double roll_rad = 0.1;
  double opening = 1.0;  // factor of how wide it opens, 0: stays closed

  /// Marker i at a time: lips that open, round and drift, each a smooth function of time.
  Eigen::Vector2d marker(int i, double time_s) const {
    const double open =
        opening * 0.5 * (1.0 - std::cos(6.0 * time_s)) * (0.6 + 0.4 * std::sin(time_s));
    const double width = width_px * (1.0 - 0.15 * std::sin(4.0 * time_s + 0.4));
    const double angle = std::numbers::pi * (1.0 + (i % 8) / 4.0);  // from the left, clockwise
    const bool inner = i >= 8, lower = std::sin(angle) > 0.0;
    const double half_width = 0.5 * width * (inner ? 0.85 : 1.0);
    const double half_open = width_px * open * (lower ? 0.35 : 0.08);
    const double lip = inner ? 0.0 : 0.17 * width_px;
    const Eigen::Vector2d flat(half_width * std::cos(angle), (half_open + lip) * std::sin(angle));
    const Eigen::Vector2d drift(8.0 * std::sin(0.9 * time_s), 3.0 * std::sin(1.7 * time_s));
    return middle_px + drift + Eigen::Rotation2Dd(roll_rad * std::cos(1.1 * time_s)) * flat;
  }

  LipTrack track(int frames, double frames_per_second, int marker_count = 16) const {
    LipTrack track;
    track.marker_count = marker_count;
    for (int f = 0; f < frames; ++f) {
      LipFrame frame{f, f / frames_per_second, 1.0, {}};
      for (int i = 0; i < marker_count; ++i) {
        frame.markers.push_back(
            {MarkerState::seen, marker(i, frame.time_s), Eigen::Vector2d::Zero()});
      }
      track.frames.push_back(frame);
    }
    return track;
  }
};

}  // namespace semblance::testing
