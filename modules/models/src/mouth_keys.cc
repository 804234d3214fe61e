#include "semblance/models/mouth_keys.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Vector2d;

constexpr int outer_count = 8, most_candidates = 32, most_rounds = 5;
constexpr double corner_inset = 0.1, farthest_px = 1e6, fastest_px_s = 1e7;

bool has_outer_contour(const LipFrame& frame) {
  return std::all_of(frame.markers.begin(), frame.markers.begin() + outer_count,
                     [](const LipMarker& m) { return m.state != MarkerState::absent; });
}

std::vector<Vector2d> positions(const LipFrame& frame) {
  std::vector<Vector2d> list;
  for (const LipMarker& marker : frame.markers) list.push_back(marker.position_px);
  return list;
}

/// The marker of the other lip below or above marker i; a corner is its own.
int opposite(int i) { return (outer_count - i) % outer_count; }

/// From outer to inner markers, in the mouth's own axes (along, down).
using Insets = std::array<Vector2d, outer_count>;

Insets closed_insets(const LipFrame& frame) {
  const std::vector<Vector2d> outer = positions(frame);
  const MouthFrame mouth = mouth_frame(outer);
  Insets insets;
  for (int i = 0; i < outer_count; ++i) {
    const Vector2d half = 0.5 * (outer[opposite(i)] - outer[i]);
    insets[i] = {mouth.along.dot(half), mouth.down.dot(half)};
  }
  insets[0] = {corner_inset * mouth.width_px, 0.0};
  insets[4] = -insets[0];
  return insets;
}

/// Sum of the distances between upper and lower markers.
double opening(const LipFrame& frame) {
  double sum = 0.0;
  for (const int i : {1, 2, 3}) {
    sum += (frame.markers[i].position_px - frame.markers[opposite(i)].position_px).norm();
  }
  return sum;
}

void add_inner_contour(const Insets& insets, LipFrame& frame) {
  frame.markers.resize(2 * outer_count);
  if (frame.markers[0].state == MarkerState::absent ||
      frame.markers[4].state == MarkerState::absent) {
    return;
  }
  const MouthFrame mouth = mouth_frame(positions(frame));
  for (int i = 0; i < outer_count; ++i) {
    const LipMarker& outer = frame.markers[i];
    if (outer.state == MarkerState::absent) continue;
    frame.markers[outer_count + i] = {
        MarkerState::bridged,
        outer.position_px + insets[i].x() * mouth.along + insets[i].y() * mouth.down,
        outer.velocity_px_s};
  }
}

Vector2d slope(const LipTrack& track, int row, int neighbours, int marker) {
  const int first = std::max(0, row - neighbours);
  const int last = std::min(static_cast<int>(track.frames.size()) - 1, row + neighbours);
  int count = 0;
  double mean_s = 0.0;
  Vector2d mean_px = Vector2d::Zero();
  const auto for_each_seen = [&](const auto& visit) {
    for (int k = first; k <= last; ++k) {
      const LipMarker& seen = track.frames[k].markers[marker];
      if (seen.state != MarkerState::absent) visit(track.frames[k].time_s, seen.position_px);
    }
  };
  for_each_seen([&](double time_s, const Vector2d& position) {
    ++count;
    mean_s += time_s;
    mean_px += position;
  });
  if (count < 2) {
    throw InvalidInput(fmt::format(
        "frame {}: marker {} is absent in the {} frames on either side, so it has no velocity; use "
        "more neighbours, or 0 to take the velocities of the file",
        track.frames[row].frame, marker, neighbours));
  }
  mean_s /= count;
  mean_px /= count;
  double spread = 0.0;
  Vector2d moment = Vector2d::Zero();
  for_each_seen([&](double time_s, const Vector2d& position) {
    spread += (time_s - mean_s) * (time_s - mean_s);
    moment += (time_s - mean_s) * (position - mean_px);
  });
  return moment / spread;
}

/// Squared distances to the markers of a frame and how many there are.
struct FrameError {
  double squared = 0.0;
  int markers = 0;
  double rms() const { return markers > 0 ? std::sqrt(squared / markers) : 0.0; }
};

FrameError frame_error(const LipFrame& frame, const MouthPoints& position_px) {
  FrameError error;
  for (std::size_t i = 0; i < frame.markers.size(); ++i) {
    const LipMarker& marker = frame.markers[i];
    if (marker.state == MarkerState::absent) continue;
    const auto row = static_cast<Eigen::Index>(i);
    error.squared +=
        (position_px.row(row).head<2>().transpose() - marker.position_px).squaredNorm();
    ++error.markers;
  }
  return error;
}

/// What the motion between two key frames leaves of the frames between them.
struct Segment {
  int first = 0, last = 0;  // rows
  double squared = 0.0;
  double urgency = 0.0;  // the same, but 0 for a segment that is good enough or cannot be split
};

struct Split {
  Segment before, after;
  double squared() const { return before.squared + after.squared; }
  bool urgent() const { return before.urgency > 0.0 || after.urgency > 0.0; }
};

class KeyChooser {
 public:
  KeyChooser(const LipTrack& track, const KeyChoice& choice) : track_(track), choice_(choice) {
    keys_.resize(track.frames.size());
  }

  std::vector<int> choose() {
    const auto complete = complete_rows(-1, static_cast<int>(track_.frames.size()));
    if (complete.size() < 2) {
      throw InvalidInput(
          fmt::format("{} frame(s) with all markers: key frames need two; absent markers cannot be "
                      "animated",
                      complete.size()));
    }
    const std::vector<Segment> divided =
        settled(divide({measured(complete.front(), complete.back())}));
    const std::vector<Segment> even = settled(evenly(complete, divided.size()));
    return rows_of(is_better(even, divided) ? even : divided);
  }

 private:
  /// Rows strictly between two whose markers are all there.
  std::vector<int> complete_rows(int before, int after) const {
    std::vector<int> rows;
    for (int row = before + 1; row < after; ++row) {
      if (is_complete(track_.frames[row])) rows.push_back(row);
    }
    return rows;
  }

  const MouthKey& key(int row) {
    std::optional<MouthKey>& key = keys_[row];
    if (!key) key = make_key(track_, row, choice_.neighbours);
    return *key;
  }

  Segment measured(int first, int last) {
    const MouthMotion motion({key(first), key(last)}, choice_.controls, choice_.reference_px);
    Segment segment{first, last, 0.0, 0.0};
    bool divisible = false;
    double worst_px = 0.0;
    for (int row = first + 1; row < last; ++row) {
      motion.at(track_.frames[row].time_s, points_);
      const FrameError error = frame_error(track_.frames[row], points_);
      segment.squared += error.squared;
      worst_px = std::max(worst_px, error.rms());
      divisible = divisible || is_complete(track_.frames[row]);
    }
    if (divisible && worst_px > choice_.tolerance_px) segment.urgency = segment.squared;
    return segment;
  }

  Split best_split(int first, int last) {
    const std::vector<int> rows = complete_rows(first, last);
    const int count = std::min(most_candidates, static_cast<int>(rows.size()));
    Split best;
    for (int i = 0; i < count; ++i) {
      const int row = rows[(2 * i + 1) * rows.size() / (2 * count)];
      const Split split{measured(first, row), measured(row, last)};
      if (i == 0 || split.squared() < best.squared()) best = split;
    }
    return best;
  }

  std::vector<Segment> divide(std::vector<Segment> segments) {
    while (static_cast<int>(segments.size()) + 1 < choice_.most_keys) {
      const auto worst = std::max_element(
          segments.begin(), segments.end(),
          [](const Segment& a, const Segment& b) { return a.urgency < b.urgency; });
      if (worst->urgency <= 0.0) break;
      const Split split = best_split(worst->first, worst->last);
      *worst = split.before;
      segments.insert(worst + 1, split.after);
    }
    return segments;
  }

  std::vector<Segment> evenly(const std::vector<int>& rows, std::size_t count) {
    std::vector<Segment> segments;
    for (std::size_t i = 0; i < count; ++i) {
      segments.push_back(
          measured(rows[i * (rows.size() - 1) / count], rows[(i + 1) * (rows.size() - 1) / count]));
    }
    return segments;
  }

  /// Moves inner keys, one after the other, to where they leave least.
  std::vector<Segment> settled(std::vector<Segment> segments) {
    bool moved = true;
    for (int round = 0; moved && round < most_rounds; ++round) {
      moved = false;
      for (std::size_t i = 1; i < segments.size(); ++i) {
        const Split now{segments[i - 1], segments[i]},
            split = best_split(now.before.first, now.after.last);
        if (!(split.squared() < now.squared()) || (!now.urgent() && split.urgent())) continue;
        segments[i - 1] = split.before;
        segments[i] = split.after;
        moved = true;
      }
    }
    return segments;
  }

  /// Within the tolerance where the other is not, or else with the smaller error.
  static bool is_better(const std::vector<Segment>& a, const std::vector<Segment>& b) {
    double squared_a = 0.0, squared_b = 0.0;
    bool urgent_a = false, urgent_b = false;
    for (const Segment& segment : a) {
      squared_a += segment.squared;
      urgent_a = urgent_a || segment.urgency > 0.0;
    }
    for (const Segment& segment : b) {
      squared_b += segment.squared;
      urgent_b = urgent_b || segment.urgency > 0.0;
    }
    return urgent_a == urgent_b ? squared_a < squared_b : urgent_b;
  }

  static std::vector<int> rows_of(const std::vector<Segment>& segments) {
    std::vector<int> rows{segments.front().first};
    for (const Segment& segment : segments) rows.push_back(segment.last);
    return rows;
  }

  const LipTrack& track_;
  const KeyChoice& choice_;
  std::vector<std::optional<MouthKey>> keys_;
  MouthPoints points_;
};

}  // namespace

LipTrack with_inner_contour(const LipTrack& track) {
  if (track.marker_count != outer_count) return track;
  const LipFrame* closed = nullptr;
  for (const LipFrame& frame : track.frames) {
    if (!has_outer_contour(frame)) continue;
    if (closed == nullptr || opening(frame) < opening(*closed)) closed = &frame;
  }
  if (closed == nullptr) {
    throw InvalidInput("no frame has all 8 markers, so the lips' thickness is unknown");
  }
  const Insets insets = closed_insets(*closed);
  LipTrack result = track;
  result.marker_count = 2 * outer_count;
  for (LipFrame& frame : result.frames) add_inner_contour(insets, frame);
  return result;
}

int find_frame(const LipTrack& track, int frame) {
  for (std::size_t row = 0; row < track.frames.size(); ++row) {
    if (track.frames[row].frame == frame) return static_cast<int>(row);
  }
  throw InvalidInput(fmt::format("frame {} is not in the table, which has {} frames from {} to {}",
                                 frame, track.frames.size(), track.frames.front().frame,
                                 track.frames.back().frame));
}

bool is_complete(const LipFrame& frame) {
  return std::none_of(frame.markers.begin(), frame.markers.end(),
                      [](const LipMarker& m) { return m.state == MarkerState::absent; });
}

MouthKey make_key(const LipTrack& track, int row, int neighbours) {
  const LipFrame& frame = track.frames[row];
  MouthKey key{frame.frame, frame.time_s, {}, {}, {}, {}};
  for (int i = 0; i < track.marker_count; ++i) {
    const LipMarker& marker = frame.markers[i];
    if (marker.state == MarkerState::absent) {
      throw InvalidInput(
          fmt::format("frame {} cannot be a key frame: marker {} is absent; choose a "
                      "frame where all are there",
                      frame.frame, i));
    }
    const Vector2d velocity =
        neighbours > 0 ? slope(track, row, neighbours, i) : marker.velocity_px_s;
    if (!(marker.position_px.norm() <= farthest_px && velocity.norm() <= fastest_px_s)) {
      throw InvalidInput(fmt::format(
          "frame {}: marker {} is at ({:g}, {:g}) and moves at {:g} pixels per second, which no "
          "picture shows; correct it or choose other key frames",
          frame.frame, i, marker.position_px.x(), marker.position_px.y(), velocity.norm()));
    }
    key.position_px.push_back(marker.position_px);
    key.velocity_px_s.push_back(velocity);
    key.depth_px.push_back(0.0);
  }
  try {
    mouth_frame(key.position_px);
  } catch (const InvalidInput& error) {
    throw InvalidInput(
        fmt::format("frame {} cannot be a key frame: {}", frame.frame, error.what()));
  }
  return key;
}

std::vector<int> choose_keys(const LipTrack& track, const KeyChoice& choice) {
  if (choice.most_keys < 2) {
    throw InvalidInput(
        fmt::format("a budget of {} key frames: at least 2 are needed", choice.most_keys));
  }
  if (!(choice.tolerance_px >= 0.0)) {
    throw InvalidInput("the tolerance must be a number of pixels, 0 or more");
  }
  return KeyChooser(track, choice).choose();
}

MotionError motion_error(const LipTrack& track, const std::vector<int>& key_rows,
                         const MouthMotion& motion) {
  MotionError result;
  FrameError all;
  MouthPoints points;
  for (int row = key_rows.front() + 1; row < key_rows.back(); ++row) {
    if (std::binary_search(key_rows.begin(), key_rows.end(), row)) continue;
    motion.at(track.frames[row].time_s, points);
    const FrameError error = frame_error(track.frames[row], points);
    if (error.markers == 0) continue;
    ++result.frames;
    all.squared += error.squared;
    all.markers += error.markers;
    if (error.rms() > result.worst_px) {
      result.worst_px = error.rms();
      result.worst_frame = track.frames[row].frame;
    }
  }
  result.rms_px = all.rms();
  return result;
}

}  // namespace semblance
