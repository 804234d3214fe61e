#include "semblance/lips/complete_track.h"

#include <cmath>
#include <optional>

#include "semblance/lips/mouth_layout.h"

namespace semblance {
namespace {

using Eigen::Vector2d;
using Track = std::vector<LipEstimate>;

bool seen(const LipEstimate& estimate, std::size_t marker) {
  return estimate.markers[marker].marker.state == MarkerState::seen;
}

const Vector2d& place(const LipEstimate& estimate, std::size_t marker) {
  return estimate.markers[marker].marker.position_px;
}

/// Where the marker would be in frame `to` had it moved from frame `from` like those in `witnesses`
/// that both frames saw; nothing without any.
std::optional<Vector2d> carried(const Track& track, std::size_t from, std::size_t to,
                                std::size_t marker, const std::vector<bool>& witnesses) {
  std::vector<Vector2d> before, after;
  for (std::size_t i = 0; i < witnesses.size(); ++i) {
    if (!witnesses[i] || i == marker || !seen(track[from], i) || !seen(track[to], i)) continue;
    before.push_back(place(track[from], i));
    after.push_back(place(track[to], i));
  }
  if (before.empty()) return {};
  return fit_map(before, after)(place(track[from], marker));
}

std::optional<Vector2d> bridged_place(const Track& track, std::size_t a, std::size_t t,
                                      std::size_t b, std::size_t marker,
                                      const std::vector<bool>& witnesses) {
  const auto from_a = carried(track, a, t, marker, witnesses),
             from_b = carried(track, b, t, marker, witnesses);
  if (!from_a || !from_b) return {};
  const double s = static_cast<double>(t - a) / static_cast<double>(b - a);
  return (1.0 - s) * *from_a + s * *from_b;
}

std::vector<bool> seen_markers(const LipEstimate& estimate) {
  std::vector<bool> out;
  for (std::size_t i = 0; i < estimate.markers.size(); ++i) out.push_back(seen(estimate, i));
  return out;
}

/// rms error of the rule `ahead` frames into gaps of `length` frames where the marker was seen.
Vector2d rule_sigma(const Track& track, std::size_t marker, std::size_t ahead, std::size_t length,
                    const std::vector<bool>& witnesses) {
  constexpr std::size_t kFewest = 5;
  Vector2d squares = Vector2d::Zero();
  std::size_t count = 0, run = 0;
  for (std::size_t b = 0; b < track.size(); ++b) {
    run = seen(track[b], marker) ? run + 1 : 0;
    if (run <= length) continue;
    const std::size_t a = b - length, t = a + ahead;
    const auto guess = bridged_place(track, a, t, b, marker, witnesses);
    if (!guess) continue;
    squares += (*guess - place(track[t], marker)).cwiseAbs2();
    ++count;
  }
  if (count < kFewest) return Vector2d::Constant(-1.0);
  return (squares / static_cast<double>(count)).cwiseSqrt();
}

void bridge(Track& track, std::size_t a, std::size_t b, std::size_t marker) {
  for (std::size_t t = a + 1; t < b; ++t) {
    if (track[t].status == TrackStatus::lost) continue;
    const std::vector<bool> witnesses = seen_markers(track[t]);
    const auto guess = bridged_place(track, a, t, b, marker, witnesses);
    if (!guess) continue;
    TrackedMarker& m = track[t].markers[marker];
    m.marker.state = MarkerState::bridged;
    m.marker.position_px = *guess;
    m.sigma_px = rule_sigma(track, marker, t - a, b - a, witnesses);
  }
}

/// Whether `other` may stand beside `here` in a velocity.
bool same_state(const TrackedMarker& here, const TrackedMarker& other) {
  return other.known() &&
         (here.marker.state == MarkerState::bridged || other.marker.state == MarkerState::seen);
}

/// The furthest frame within `neighbours` steps that the marker's state reaches.
std::size_t reach(const Track& track, std::size_t t, std::size_t marker, int step, int neighbours) {
  std::size_t at = t;
  for (int i = 0; i < neighbours; ++i) {
    if (step < 0 ? at == 0 : at + 1 == track.size()) break;
    const std::size_t next = step < 0 ? at - 1 : at + 1;
    const bool adjacent = std::abs(track[next].frame - track[at].frame) == 1;
    if (!adjacent || !same_state(track[t].markers[marker], track[next].markers[marker])) break;
    at = next;
  }
  return at;
}

}  // namespace

void bridge_gaps(std::vector<LipEstimate>& track) {
  for (LipEstimate& estimate : track) {
    for (TrackedMarker& m : estimate.markers) {
      if (m.marker.state == MarkerState::bridged) m = {};
    }
  }
  const std::size_t markers = track.empty() ? 0 : track.front().markers.size();
  for (std::size_t i = 0; i < markers; ++i) {
    std::optional<std::size_t> last;
    for (std::size_t t = 0; t < track.size(); ++t) {
      if (!seen(track[t], i)) continue;
      const bool gap = last && t > *last + 1;
      if (gap && track[t].time_s - track[*last].time_s <= kLongestBridgeS) {
        bridge(track, *last, t, i);
      }
      last = t;
    }
  }
}

void add_velocities(std::vector<LipEstimate>& track, int neighbours) {
  for (std::size_t t = 0; t < track.size(); ++t) {
    for (std::size_t i = 0; i < track[t].markers.size(); ++i) {
      LipMarker& marker = track[t].markers[i].marker;
      marker.velocity_px_s.setZero();
      if (marker.state == MarkerState::absent) continue;
      const std::size_t a = reach(track, t, i, -1, neighbours),
                        b = reach(track, t, i, 1, neighbours);
      if (a == b) continue;
      marker.velocity_px_s =
          (place(track[b], i) - place(track[a], i)) / (track[b].time_s - track[a].time_s);
    }
  }
}

}  // namespace semblance
