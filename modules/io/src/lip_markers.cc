#include "semblance/io/lip_markers.h"

#include <fmt/format.h>

#include "parsers.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

constexpr int columns_before = 3, columns_per_marker = 5;
constexpr std::size_t most_frames = 10'000'000;

std::string heading(int marker_count) {
  std::string line = "frame,time_s,confidence";
  for (int i = 0; i < marker_count; ++i) {
    line += fmt::format(",state_{0},x_{0}_px,y_{0}_px,vx_{0}_px_s,vy_{0}_px_s", i);
  }
  return line;
}

std::vector<std::string_view> cells(std::string_view line) {
  std::vector<std::string_view> list;
  for (std::size_t comma; (comma = line.find(',')) != std::string_view::npos;
       line.remove_prefix(comma + 1)) {
    list.push_back(line.substr(0, comma));
  }
  list.push_back(line);
  return list;
}

// Turns the cells of one line into a frame; `fail` throws with the line's number.
template <typename Fail>
LipFrame parse_frame(const std::vector<std::string_view>& cell, int marker_count,
                     const Fail& fail) {
  LipFrame frame;
  const auto number = [&](std::string_view word, auto& value, const char* what) {
    if (!text::parse(word, value)) {
      fail(fmt::format("{} is not a {}; a finite number was expected", text::quoted(word), what));
    }
  };
  number(cell[0], frame.frame, "frame");
  number(cell[1], frame.time_s, "time");
  number(cell[2], frame.confidence, "confidence");
  if (frame.confidence < 0.0 || frame.confidence > 1.0) fail("the confidence must be in [0, 1]");
  for (int i = 0; i < marker_count; ++i) {
    const auto* at = &cell[columns_before + columns_per_marker * i];
    LipMarker marker;
    if (at[0] == "seen" || at[0] == "bridged") {
      marker.state = at[0] == "seen" ? MarkerState::seen : MarkerState::bridged;
      number(at[1], marker.position_px.x(), "position");
      number(at[2], marker.position_px.y(), "position");
      number(at[3], marker.velocity_px_s.x(), "velocity");
      number(at[4], marker.velocity_px_s.y(), "velocity");
    } else if (at[0] != "absent") {
      fail(fmt::format("state {} of marker {} must be seen, bridged or absent", text::quoted(at[0]),
                       i));
    }
    frame.markers.push_back(marker);
  }
  return frame;
}

}  // namespace

std::string to_string(MarkerState state) {
  switch (state) {
    case MarkerState::seen:
      return "seen";
    case MarkerState::bridged:
      return "bridged";
    case MarkerState::absent:
      break;
  }
  return "absent";
}

LipTrack parse_lip_markers(std::string_view content, const std::string& source) {
  text::Lines lines(content);
  const auto fail = [&](const std::string& what) {
    throw InvalidInput(fmt::format("{}:{}: {}", source, lines.number(), what));
  };
  LipTrack track;
  std::string_view line;
  if (!lines.next(line)) {
    throw InvalidInput(source + ": empty; a table of lip markers was expected");
  }
  for (const int count : {8, 16}) {
    if (line == heading(count)) track.marker_count = count;
  }
  if (track.marker_count == 0) {
    fail(
        "the first line must name the columns of 8 or 16 markers: frame,time_s,confidence,"
        "state_0,x_0_px,y_0_px,vx_0_px_s,vy_0_px_s,... (docs/formats/lips.md)");
  }
  const std::size_t columns = columns_before + columns_per_marker * track.marker_count;
  while (lines.next(line)) {
    if (line.empty()) continue;
    const auto cell = cells(line);
    if (cell.size() != columns) fail(fmt::format("{} cells; {} expected", cell.size(), columns));
    LipFrame frame = parse_frame(cell, track.marker_count, fail);
    if (!track.frames.empty()) {
      const LipFrame& last = track.frames.back();
      if (!(frame.time_s > last.time_s) || frame.frame <= last.frame) {
        fail(
            fmt::format("frame {} at {} s does not come after frame {} at {} s; sort the lines "
                        "by time and leave out repeated ones",
                        frame.frame, frame.time_s, last.frame, last.time_s));
      }
    }
    if (track.frames.size() == most_frames) fail("too many frames");
    track.frames.push_back(std::move(frame));
  }
  if (track.frames.empty()) {
    throw InvalidInput(source + ": no frame after the line of column names");
  }
  return track;
}

LipTrack read_lip_markers(const std::string& path) {
  return parse_lip_markers(text::read_file(path), path);
}

void write_lip_markers(const std::string& path, const LipTrack& track) {
  AtomicFile file(path);
  file.stream() << heading(track.marker_count) << "\r\n";
  for (const LipFrame& frame : track.frames) {
    std::string line = fmt::format("{},{},{}", frame.frame, frame.time_s, frame.confidence);
    for (const LipMarker& marker : frame.markers) {
      line += fmt::format(",{}", to_string(marker.state));
      if (marker.state == MarkerState::absent) {
        line += ",,,,";
      } else {
        line += fmt::format(",{},{},{},{}", marker.position_px.x(), marker.position_px.y(),
                            marker.velocity_px_s.x(), marker.velocity_px_s.y());
      }
    }
    file.stream() << line << "\r\n";
  }
  file.commit();
}

}  // namespace semblance
