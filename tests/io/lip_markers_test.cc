#include "semblance/io/lip_markers.h"

#include <gmock/gmock.h>

#include "files.h"
#include "semblance/core/errors.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::HasSubstr;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;
using testing::write_text;

LipTrack three_frames(int marker_count) {
  LipTrack track;
  track.marker_count = marker_count;
  for (int f = 0; f < 3; ++f) {
    LipFrame frame{2 * f + 1, f / 3.0, 1.0 - 0.3 * f, {}};
    for (int i = 0; i < marker_count; ++i) {
      LipMarker marker;
      if (i != 5 || f != 1) {
        marker = {i == 4 ? MarkerState::bridged : MarkerState::seen,
                  {10.0 / 3.0 + i, -7.1 * f},
                  {1e-9 * i, 1234.5}};
      }
      frame.markers.push_back(marker);
    }
    track.frames.push_back(frame);
  }
  return track;
}

TEST(LipMarkers, SurviveARoundTripToTheLastBit) {
  const TemporaryFolder folder;
  for (const int count : {8, 16}) {
    const LipTrack track = three_frames(count);
    write_lip_markers(folder.path() / "lips.csv", track);
    const LipTrack found = read_lip_markers(folder.path() / "lips.csv");
    ASSERT_EQ(found.marker_count, count);
    ASSERT_EQ(found.frames.size(), 3u);
    for (int f = 0; f < 3; ++f) {
      EXPECT_EQ(found.frames[f].frame, track.frames[f].frame);
      EXPECT_EQ(found.frames[f].time_s, track.frames[f].time_s);
      EXPECT_EQ(found.frames[f].confidence, track.frames[f].confidence);
      for (int i = 0; i < count; ++i) {
        const LipMarker &a = found.frames[f].markers[i], &b = track.frames[f].markers[i];
        EXPECT_EQ(a.state, b.state);
        EXPECT_EQ(a.position_px, b.position_px);
        EXPECT_EQ(a.velocity_px_s, b.velocity_px_s);
      }
    }
  }
}

std::string heading() {
  const TemporaryFolder folder;
  write_lip_markers(folder.path() / "lips.csv", LipTrack{8, {}});
  return testing::read_text(folder.path() / "lips.csv");
}

std::string row(const std::string& start, const std::string& first_marker) {
  std::string line = start + first_marker;
  for (int i = 1; i < 8; ++i) line += ",seen,1,2,0,0";
  return line + "\n";
}

void expect_message(const std::string& content, const std::string& message) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "lips.csv";
  write_text(path, content);
  EXPECT_THAT([&] { read_lip_markers(path); },
              ThrowsMessage<InvalidInput>(::testing::AllOf(HasSubstr(path), HasSubstr(message))));
}

TEST(LipMarkers, RejectWithAMessage) {
  const std::string good = ",seen,1,2,0,0";
  expect_message("", "empty");
  expect_message("x,y\n1,2\n", "must name the columns of 8 or 16 markers");
  expect_message(heading(), "no frame after");
  expect_message(heading() + row("0,0,1", ",seen,nan,2,0,0"), ":2: 'nan' is not a position");
  expect_message(heading() + row("0,inf,1", good), "'inf' is not a time");
  expect_message(heading() + row("0,0,2", good), "confidence must be in [0, 1]");
  expect_message(heading() + row("0,0,1", ",lost,1,2,0,0"), "state 'lost' of marker 0");
  expect_message(heading() + "0,0,1,seen\n", "4 cells; 43 expected");
  expect_message(heading() + row("0,0,1", good) + row("1,0,1", good),
                 ":3: frame 1 at 0 s does not come after frame 0 at 0 s");
}

}  // namespace
}  // namespace semblance
