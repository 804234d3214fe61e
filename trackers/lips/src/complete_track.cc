#include "semblance/lips/complete_track.h"

#include <algorithm>
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

/// How those in `witnesses` but for `marker` moved between two frames that saw them; nothing
/// without any.
std::optional<PlaneMap> witnessed_motion(const Track& track, std::size_t from, std::size_t to,
                                         std::size_t marker, const std::vector<bool>& witnesses) {
  std::vector<Vector2d> before, after;
  for (std::size_t i = 0; i < witnesses.size(); ++i) {
    if (!witnesses[i] || i == marker || !seen(track[from], i) || !seen(track[to], i)) continue;
    before.push_back(place(track[from], i));
    after.push_back(place(track[to], i));
  }
  if (before.empty()) return {};
  return fit_map(before, after);
}

/// What the witnesses say of a hidden marker in frame t.
struct Guess {
  Vector2d place_px;
  double misfit_px2;  // mean square by which the rule misses the witnesses themselves
};

std::optional<Guess> guess(const Track& track, std::size_t a, std::size_t t, std::size_t b,
                           std::size_t marker, const std::vector<bool>& witnesses) {
  const auto from_a = witnessed_motion(track, a, t, marker, witnesses),
             from_b = witnessed_motion(track, b, t, marker, witnesses);
  if (!from_a || !from_b) return {};
  const double s = static_cast<double>(t - a) / static_cast<double>(b - a);
  const auto carried = [&](std::size_t i) -> Vector2d {
    return (1.0 - s) * (*from_a)(place(track[a], i)) + s * (*from_b)(place(track[b], i));
  };
  double squares = 0.0;
  int count = 0;
  for (std::size_t i = 0; i < witnesses.size(); ++i) {
    const bool common = seen(track[a], i) && seen(track[t], i) && seen(track[b], i);
    if (!witnesses[i] || i == marker || !common) continue;
    squares += (carried(i) - place(track[t], i)).squaredNorm();
    ++count;
  }
  return Guess{carried(marker), squares / std::max(1, count)};
}

std::vector<bool> seen_markers(const LipEstimate& estimate) {
  std::vector<bool> out;
  for (std::size_t i = 0; i < estimate.markers.size(); ++i) out.push_back(seen(estimate, i));
  return out;
}

/// Variance of a guess, per axis, at one misfit: read off a line over the misfit, by weighted least
/// squares over known errors. Squared errors scatter as much as they are large, so those of
/// livelier stretches count less.
class ErrorLine {
 public:
  explicit ErrorLine(double misfit) : at_(misfit) {}

  void add(double misfit, const Vector2d& error) {
    const Vector2d square = error.cwiseAbs2();
    const double scale = misfit + at_, weight = scale > 0.0 ? 1.0 / (scale * scale) : 1.0;
    ++count_;
    weight_ += weight;
    misfit_ += weight * misfit;
    misfit_square_ += weight * misfit * misfit;
    square_ += weight * square;
    product_ += weight * misfit * square;
  }
  int count() const { return count_; }

  /// The line neither falls nor is negative anywhere: its slope lies between none and that of the
  /// line through the origin.
  Vector2d sigma() const {
    const double mean = misfit_ / weight_, spread = misfit_square_ / weight_ - mean * mean;
    Vector2d variance = square_ / weight_;
    if (!(spread > 0.0)) return variance.cwiseSqrt();
    const Vector2d slope =
        ((product_ / weight_ - mean * variance) / spread).cwiseMax(0.0).cwiseMin(variance / mean);
    variance += slope * (at_ - mean);
    return variance.cwiseMax(0.0).cwiseSqrt();
  }

 private:
  double at_;
  int count_ = 0;
  double weight_ = 0.0, misfit_ = 0.0, misfit_square_ = 0.0;
  Vector2d square_ = Vector2d::Zero(), product_ = Vector2d::Zero();
};

/// Deviation of the guess `ahead` frames into a gap of `length` frames that has this misfit, from
/// such stretches of the clip in which the marker was seen; negative where these are too few.
Vector2d guess_sigma(const Track& track, std::size_t marker, std::size_t ahead, std::size_t length,
                     const std::vector<bool>& witnesses, double misfit_px2) {
  constexpr int kFewest = 5;
  ErrorLine errors(misfit_px2);
  std::size_t run = 0;
  for (std::size_t b = 0; b < track.size(); ++b) {
    run = seen(track[b], marker) ? run + 1 : 0;
    if (run <= length) continue;
    const std::size_t a = b - length, t = a + ahead;
    const auto known = guess(track, a, t, b, marker, witnesses);
    if (known) errors.add(known->misfit_px2, known->place_px - place(track[t], marker));
  }
  if (errors.count() < kFewest) return Vector2d::Constant(-1.0);
  return errors.sigma();
}

void bridge(Track& track, std::size_t a, std::size_t b, std::size_t marker) {
  for (std::size_t t = a + 1; t < b; ++t) {
    if (track[t].status == TrackStatus::lost) continue;
    const std::vector<bool> witnesses = seen_markers(track[t]);
    const auto bridged = guess(track, a, t, b, marker, witnesses);
    if (!bridged) continue;
    TrackedMarker& m = track[t].markers[marker];
    m.marker.state = MarkerState::bridged;
    m.marker.position_px = bridged->place_px;
    m.sigma_px = guess_sigma(track, marker, t - a, b - a, witnesses, bridged->misfit_px2);
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
