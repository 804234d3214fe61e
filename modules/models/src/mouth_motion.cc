#include "semblance/models/mouth_motion.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Vector2d;

constexpr int left_corner = 0, right_corner = 4;
constexpr std::array<int, 4> middle_markers{2, 6, 10, 14};

MarkerKey marker_key(const MouthKey& key, std::size_t i) {
  return {key.time_s, key.position_px[i], key.velocity_px_s[i], key.depth_px[i]};
}

std::vector<MarkerPath> make_segment(const MouthKey& first, const MouthKey& second,
                                     const MarkerControls& controls, const Vector2d& reference) {
  std::vector<MarkerPath> paths;
  for (std::size_t i = 0; i < first.position_px.size(); ++i) {
    try {
      paths.emplace_back(marker_key(first, i), marker_key(second, i), reference, controls);
    } catch (const InvalidInput& error) {
      throw InvalidInput(fmt::format("key frames {} and {}, marker {}: {}", first.frame,
                                     second.frame, i, error.what()));
    }
  }
  return paths;
}

}  // namespace

MouthFrame mouth_frame(const std::vector<Vector2d>& markers_px) {
  const Vector2d across = markers_px[right_corner] - markers_px[left_corner];
  const double width = across.norm();
  if (!(width > 0.0)) {
    throw InvalidInput(
        "the corners of the mouth (markers 0 and 4) are at one place; correct the markers or leave "
        "the frame out");
  }
  const Vector2d along = across / width;
  return {0.5 * (markers_px[left_corner] + markers_px[right_corner]),
          along,
          {-along.y(), along.x()},
          width};
}

Vector2d mouth_reference(const std::vector<Vector2d>& markers_px) {
  const MouthFrame frame = mouth_frame(markers_px);
  std::array<double, middle_markers.size()> heights{};
  for (std::size_t i = 0; i < heights.size(); ++i) {
    heights[i] = frame.down.dot(markers_px[middle_markers[i]] - frame.middle_px);
  }
  std::sort(heights.begin(), heights.end());
  double widest = -1.0, middle = 0.0;
  for (std::size_t i = 1; i < heights.size(); ++i) {
    const double gap = heights[i] - heights[i - 1];
    if (gap > widest) widest = gap, middle = 0.5 * (heights[i] + heights[i - 1]);
  }
  return frame.middle_px + middle * frame.down;
}

MouthMotion::MouthMotion(const std::vector<MouthKey>& keys, const MarkerControls& controls,
                         const std::optional<Vector2d>& reference_px) {
  if (keys.size() < 2) {
    throw InvalidInput(fmt::format(
        "{} key frame(s): a motion runs between at least two; name more of them", keys.size()));
  }
  for (const MouthKey& key : keys) {
    const std::size_t count = key.position_px.size();
    if (count != 16 || key.velocity_px_s.size() != count || key.depth_px.size() != count) {
      throw InvalidInput(fmt::format(
          "key frame {}: 16 markers with velocities and depths were expected", key.frame));
    }
    times_s_.push_back(key.time_s);
  }
  for (std::size_t i = 1; i < keys.size(); ++i) {
    const Vector2d reference = reference_px.value_or(mouth_reference(keys[i - 1].position_px));
    segments_.push_back(make_segment(keys[i - 1], keys[i], controls, reference));
  }
}

int MouthMotion::segment_at(double time_s) const {
  const auto after = std::upper_bound(times_s_.begin(), times_s_.end(), time_s);
  return std::clamp(static_cast<int>(after - times_s_.begin()) - 1, 0, segment_count() - 1);
}

void MouthMotion::at(double time_s, MouthPoints& position_px, MouthPoints* velocity_px_s) const {
  const std::vector<MarkerPath>& paths = segments_[segment_at(time_s)];
  position_px.resize(marker_count(), 3);
  if (velocity_px_s != nullptr) velocity_px_s->resize(marker_count(), 3);
  for (int i = 0; i < marker_count(); ++i) {
    const PathPoint state = paths[i].at(time_s);
    position_px.row(i) = state.position;
    if (velocity_px_s != nullptr) velocity_px_s->row(i) = state.velocity;
  }
}

}  // namespace semblance
