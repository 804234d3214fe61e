#include "semblance/lips/lip_estimate.h"

#include <cmath>
#include <limits>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using nlohmann::json;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

json pair(const Eigen::Vector2d& v) { return {v.x(), v.y()}; }

Eigen::Vector2d pair_from(const json& value) {
  return {value.at(0).get<double>(), value.at(1).get<double>()};
}

TrackedMarker marker_from(const json& value) {
  TrackedMarker out;
  const auto state = value.at("state").get<std::string>();
  if (state == "absent") return out;
  if (state != "seen" && state != "bridged") throw InvalidInput("unknown state '" + state + "'");
  out.marker.state = state == "seen" ? MarkerState::seen : MarkerState::bridged;
  out.marker.position_px = pair_from(value.at("position_px"));
  out.marker.velocity_px_s = pair_from(value.at("velocity_px_s"));
  if (!value.at("sigma_px").is_null()) out.sigma_px = pair_from(value.at("sigma_px"));
  return out;
}

}  // namespace

double mouth_opening(const LipEstimate& estimate) {
  const std::size_t first = estimate.markers.size() == 16 ? 8 : 0;
  const auto at = [&](std::size_t i) -> Eigen::Vector2d {
    const TrackedMarker& m = estimate.markers[first + i];
    return m.known() ? m.marker.position_px : Eigen::Vector2d::Constant(kNan);
  };
  return (at(2) - at(6)).norm() / (at(0) - at(4)).norm();
}

TrackFrame to_track_frame(const LipEstimate& estimate) {
  TrackFrame frame;
  frame.frame = estimate.frame;
  frame.time_s = estimate.time_s;
  frame.status = estimate.status;
  frame.residual_rms = estimate.residual_rms;
  frame.extra = json::object();
  if (estimate.status == TrackStatus::lost) return frame;
  int seen = 0;
  json markers = json::array();
  for (const TrackedMarker& m : estimate.markers) {
    seen += m.marker.state == MarkerState::seen ? 1 : 0;
    json entry = {{"state", to_string(m.marker.state)}};
    if (m.known()) {
      entry["position_px"] = pair(m.marker.position_px);
      entry["sigma_px"] = m.sigma_px.minCoeff() < 0.0 ? json() : pair(m.sigma_px);
      entry["velocity_px_s"] = pair(m.marker.velocity_px_s);
    }
    markers.push_back(std::move(entry));
  }
  frame.inlier_fraction = static_cast<double>(seen) / static_cast<double>(estimate.markers.size());
  const double opening = mouth_opening(estimate);
  frame.extra["markers"] = std::move(markers);
  frame.extra["confidence"] = estimate.confidence;
  frame.extra["opening"] = std::isfinite(opening) ? json(opening) : json();
  return frame;
}

LipEstimate from_track_frame(const TrackFrame& frame, int marker_count, const std::string& source) {
  LipEstimate out;
  out.frame = frame.frame;
  out.time_s = frame.time_s;
  out.status = frame.status;
  out.markers.resize(static_cast<std::size_t>(marker_count));
  if (frame.status == TrackStatus::lost) return out;
  try {
    out.residual_rms = frame.residual_rms;
    out.confidence = frame.extra.at("confidence").get<double>();
    const json& markers = frame.extra.at("markers");
    if (markers.size() != out.markers.size()) throw InvalidInput("wrong number of markers");
    for (std::size_t i = 0; i < out.markers.size(); ++i) out.markers[i] = marker_from(markers[i]);
  } catch (const std::exception& problem) {
    throw InvalidInput(source + ": frame " + std::to_string(frame.frame) +
                       ": not a line of a track of lips (" + problem.what() +
                       "); track the clip again");
  }
  return out;
}

LipTrack to_lip_track(const std::vector<LipEstimate>& estimates, int marker_count) {
  LipTrack track{marker_count, {}};
  for (const LipEstimate& estimate : estimates) {
    LipFrame frame{estimate.frame, estimate.time_s, estimate.confidence, {}};
    for (const TrackedMarker& m : estimate.markers) frame.markers.push_back(m.marker);
    track.frames.push_back(std::move(frame));
  }
  return track;
}

}  // namespace semblance
