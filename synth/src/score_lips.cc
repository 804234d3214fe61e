#include "semblance/synth/score_lips.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "quantile.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

using nlohmann::json;

/// Distance of a place from the nearest true marker other than `own`.
double nearest_other_px(const LipFrame& truth, std::size_t own, const Eigen::Vector2d& place) {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < truth.markers.size(); ++i) {
    if (i != own) nearest = std::min(nearest, (truth.markers[i].position_px - place).norm());
  }
  return nearest;
}

void add_seen(const LipFrame& truth, std::size_t i, const LipMarker& found, LipScore& score) {
  const LipMarker& real = truth.markers[i];
  const double error_px = (found.position_px - real.position_px).norm();
  if (nearest_other_px(truth, i, found.position_px) < error_px) ++score.swapped;
  if (real.state == MarkerState::seen) {
    ++score.seen;
    score.seen_errors_px.push_back(error_px);
    score.velocity_errors_px_s.push_back((found.velocity_px_s - real.velocity_px_s).norm());
  } else if (3.0 * error_px > nearest_other_px(truth, i, real.position_px)) {
    ++score.invented;
  }
}

void add_frame(const LipFrame& truth, const LipFrame* found, LipScore& score) {
  ++score.frames;
  bool lost = true;
  for (std::size_t i = 0; i < truth.markers.size(); ++i) {
    const bool visible = truth.markers[i].state == MarkerState::seen;
    score.visible += visible ? 1 : 0;
    const LipMarker marker = found == nullptr ? LipMarker{} : found->markers[i];
    lost = lost && marker.state == MarkerState::absent;
    if (marker.state == MarkerState::absent) {
      score.missed += visible ? 1 : 0;
    } else if (marker.state == MarkerState::seen) {
      add_seen(truth, i, marker, score);
    } else {
      ++score.bridged;
      score.bridged_errors_px.push_back((marker.position_px - truth.markers[i].position_px).norm());
    }
  }
  score.lost_frames += lost ? 1 : 0;
}

void summarise(LipScore& score) {
  score.seen_px = spread(score.seen_errors_px);
  score.bridged_px = spread(score.bridged_errors_px);
  score.velocity_px_s = spread(score.velocity_errors_px_s);
}

json number(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

json to_json(const Spread& spread) {
  return {{"median", number(spread.median)}, {"p95", number(spread.p95)}};
}

json to_json(const LipScore& score) {
  return {{"name", score.name},
          {"frames", score.frames},
          {"lost_frames", score.lost_frames},
          {"visible", score.visible},
          {"seen", score.seen},
          {"missed", score.missed},
          {"bridged", score.bridged},
          {"invented", score.invented},
          {"swapped", score.swapped},
          {"seen_px", to_json(score.seen_px)},
          {"bridged_px", to_json(score.bridged_px)},
          {"velocity_px_s", to_json(score.velocity_px_s)}};
}

std::string both(const Spread& spread) {
  if (!std::isfinite(spread.median)) return "-";
  return fmt::format("{:.3f}/{:.3f}", spread.median, spread.p95);
}

std::string row(const LipScore& score) {
  return fmt::format("{:<14}{:>7}{:>6}{:>9}{:>7}{:>8}{:>9}{:>10}{:>9}{:>16}{:>16}{:>16}\n",
                     score.name, score.frames, score.lost_frames, score.visible, score.seen,
                     score.missed, score.bridged, score.invented, score.swapped,
                     both(score.seen_px), both(score.bridged_px), both(score.velocity_px_s));
}

}  // namespace

LipScore score_lips(const std::string& name, const LipTrack& track, const LipTrack& truth) {
  if (track.marker_count != truth.marker_count) {
    throw InvalidInput("clip " + name + ": the track has " + std::to_string(track.marker_count) +
                       " lip markers and the truth " + std::to_string(truth.marker_count) +
                       "; track it with --markers " + std::to_string(truth.marker_count));
  }
  std::map<int, const LipFrame*> by_number;
  for (const LipFrame& frame : track.frames) by_number[frame.frame] = &frame;
  LipScore score;
  score.name = name;
  for (const LipFrame& frame : truth.frames) {
    const auto found = by_number.find(frame.frame);
    add_frame(frame, found == by_number.end() ? nullptr : found->second, score);
  }
  summarise(score);
  return score;
}

LipScore total_score(const std::vector<LipScore>& clips) {
  LipScore total;
  total.name = "all clips";
  const auto append = [](std::vector<double>& to, const std::vector<double>& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  for (const LipScore& clip : clips) {
    total.frames += clip.frames;
    total.lost_frames += clip.lost_frames;
    total.visible += clip.visible;
    total.seen += clip.seen;
    total.missed += clip.missed;
    total.bridged += clip.bridged;
    total.invented += clip.invented;
    total.swapped += clip.swapped;
    append(total.seen_errors_px, clip.seen_errors_px);
    append(total.bridged_errors_px, clip.bridged_errors_px);
    append(total.velocity_errors_px_s, clip.velocity_errors_px_s);
  }
  summarise(total);
  return total;
}

std::string lip_score_json(const std::vector<LipScore>& clips) {
  json out = {{"schema", "semblance.lip-score/1"}, {"overall", to_json(total_score(clips))}};
  for (const LipScore& clip : clips) out["clips"].push_back(to_json(clip));
  return out.dump(1);
}

std::string lip_score_table(const std::vector<LipScore>& clips) {
  std::string text =
      fmt::format("{:<14}{:>7}{:>6}{:>9}{:>7}{:>8}{:>9}{:>10}{:>9}{:>16}{:>16}{:>16}\n",
                  "lip markers", "frames", "lost", "visible", "seen", "missed", "bridged",
                  "invented", "swapped", "seen, px", "bridged, px", "velocity, px/s");
  for (const LipScore& clip : clips) text += row(clip);
  text += row(total_score(clips));
  text += "Errors are median/95th percentile over markers and frames.\n";
  return text;
}

}  // namespace semblance
