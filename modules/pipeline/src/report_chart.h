// Charts over time as inline SVG.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "semblance/io/track_file.h"

namespace semblance {

/// A quantity with one value per frame; NaN where there is none.
struct Series {
  std::string title, unit;
  std::vector<double> values, sigma;  // sigma: empty, or one per value
  std::string colour = "#0b5cad";
  std::optional<std::array<double, 2>> axis;  // least and greatest value shown; empty: fitted
};

/// What all charts of a page share.
struct TimeAxis {
  explicit TimeAxis(const std::vector<TrackFrame>& frames);

  std::vector<double> time_s;
  std::vector<TrackStatus> status;
  double frame_s = 0.0;               // median distance of frames
  double begin_s = 0.0, end_s = 0.0;  // half a frame before the first and after the last
};

/// Curve, band of +-2 sigma, shaded lost spans and marks where tracking began anew.
std::string chart_svg(const Series& series, const TimeAxis& axis, int width_px, int height_px);
/// A strip coloured by state.
std::string status_strip_svg(const TimeAxis& axis, int width_px);
/// Fill patterns that the other drawings refer to; once per page, before them.
std::string chart_definitions();

/// Spans of frames [first, last] that are lost.
struct Span {
  std::size_t first = 0, last = 0;
};
std::vector<Span> lost_spans(const std::vector<TrackStatus>& status);

}  // namespace semblance
