#include "semblance/io/track_file.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "files.h"
#include "semblance/core/errors.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::read_text;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;
using testing::write_text;

TrackHeader some_header() {
  TrackHeader header;
  header.kind = "face";
  header.seed = 18446744073709551615u;
  header.parameters = ParameterSpace({rotation_block("rotation", "pose"),
                                      translation_block("translation", 10, "pose"),
                                      scalar_block("jaw_open", "1", 0, 1, 0, 0.3, "opens")});
  header.cameras = {Camera::centred(400, 300, 500)};
  header.width = 400;
  header.height = 300;
  header.landmark_names = {"nose, \"tip\"", "chin"};
  header.config = {{"video", "a.mp4"}, {"estimate_focal", true}};
  return header;
}

TrackFrame tracked_frame(int index) {
  TrackFrame frame;
  frame.frame = index;
  frame.time_s = index / 25.0;
  frame.status = index == 3 ? TrackStatus::reinitialised : TrackStatus::tracked;
  frame.x = Eigen::VectorXd::LinSpaced(8, -1.0 / 3.0, 0.1 + index);
  frame.sigma = Eigen::VectorXd::Constant(8, 1e-17 * (1 + index));
  frame.sigma[2] = std::numeric_limits<double>::quiet_NaN();
  frame.rotation_wxyz = Eigen::Vector4d(0.1, 0.2, 0.3, 0.4).normalized();
  frame.translation_m = Eigen::Vector3d(0.01, 1e300, -0.6);
  frame.residual_rms = 0.0312;
  frame.inlier_fraction = 0.93;
  frame.landmarks_px = {{1.5, 2.25}, {100.1, -3}};
  frame.extra = {{"light", {1, 2, 3}}, {"level", "full"}};
  return frame;
}

TrackFrame lost_frame(int index) {
  TrackFrame frame;
  frame.frame = index;
  frame.time_s = index / 25.0;
  return frame;
}

TrackFrame some_frame(int index) { return index == 2 ? lost_frame(2) : tracked_frame(index); }

void write_whole(const std::string& path, int count) {
  TrackWriter writer(path, some_header());
  for (int i = 0; i < count; ++i) writer.write(some_frame(i));
}

TEST(TrackFile, KeepsEveryBit) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "track.jsonl";
  write_whole(path, 5);
  const Track track = read_track(path);
  EXPECT_EQ(track.header["seed"].get<std::uint64_t>(), 18446744073709551615u);
  EXPECT_EQ(track.header["config"], some_header().config);
  EXPECT_EQ(track.header["parameters"].size(), 8u);
  EXPECT_EQ(track.header["parameters"][7]["name"], "jaw_open");
  EXPECT_EQ(track.header["parameters"][7]["upper"], 1.0);
  EXPECT_TRUE(track.header["parameters"][0]["upper"].is_null()) << "a rotation has no bounds";
  ASSERT_EQ(track.frames.size(), 5u);
  for (int i = 0; i < 5; ++i) {
    const TrackFrame expected = some_frame(i), &found = track.frames[i];
    EXPECT_EQ(found.frame, i);
    EXPECT_EQ(found.time_s, expected.time_s);
    EXPECT_EQ(found.status, expected.status);
    EXPECT_EQ(found.x, expected.x);
    EXPECT_EQ(found.rotation_wxyz, expected.rotation_wxyz);
    EXPECT_EQ(found.translation_m, expected.translation_m);
    EXPECT_EQ(found.landmarks_px, expected.landmarks_px);
    EXPECT_EQ(found.extra, expected.extra);
    if (i == 2) continue;
    EXPECT_EQ(found.residual_rms, expected.residual_rms);
    EXPECT_EQ(found.sigma[1], expected.sigma[1]);
    EXPECT_TRUE(std::isnan(found.sigma[2]));
  }
}

TEST(TrackFile, LostFramesHoldNoEstimate) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "track.jsonl";
  write_whole(path, 3);
  const std::string text = read_text(path);
  const std::string last = text.substr(text.rfind('\n', text.size() - 2) + 1);
  EXPECT_EQ(last, "{\"frame\":2,\"time_s\":0.08,\"status\":\"lost\"}\n");
  EXPECT_TRUE(std::isnan(read_track(path).frames[2].residual_rms));
}

TEST(TrackFile, AppendGivesTheSameBytesWhereverItWasCut) {
  const TemporaryFolder folder;
  const std::string whole_path = folder.path() / "whole.jsonl", path = folder.path() / "cut.jsonl";
  write_whole(whole_path, 6);
  const std::string whole = read_text(whole_path);
  const std::size_t header_end = whole.find('\n') + 1;
  for (std::size_t cut = header_end; cut <= whole.size(); cut += 37) {
    write_text(path, whole.substr(0, cut));
    const int done = static_cast<int>(read_track(path).frames.size());
    {
      TrackWriter writer = TrackWriter::append(path);
      for (int i = done; i < 6; ++i) writer.write(some_frame(i));
    }
    ASSERT_EQ(read_text(path), whole) << "cut after byte " << cut;
  }
}

TEST(TrackFile, EveryLineIsOnDiskAtOnce) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "track.jsonl";
  TrackWriter writer(path, some_header());
  writer.write(tracked_frame(0));
  EXPECT_EQ(read_track(path).frames.size(), 1u);
}

TEST(TrackFile, CannotBeContinuedWithoutAHeader) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "track.jsonl";
  write_text(path, "{\"schema\":\"sembl");
  EXPECT_THAT([&] { TrackWriter::append(path); },
              ThrowsMessage<InvalidInput>(HasSubstr("first line is its header")));
  EXPECT_EQ(read_text(path), "{\"schema\":\"sembl") << "the file is left as it is";
}

TEST(TrackWriter, RefusesFramesThatDoNotFit) {
  const TemporaryFolder folder;
  TrackWriter writer(folder.path() / "track.jsonl", some_header());
  const auto refuse = [&](auto damage, const char* message) {
    TrackFrame frame = tracked_frame(4);
    damage(frame);
    EXPECT_THAT([&] { writer.write(frame); }, ThrowsMessage<InvalidInput>(HasSubstr(message)));
  };
  refuse([](TrackFrame& f) { f.x[1] = NAN; }, "8 finite parameter values");
  refuse([](TrackFrame& f) { f.x.conservativeResize(7); }, "8 finite parameter values");
  refuse([](TrackFrame& f) { f.sigma.conservativeResize(7); }, "sigma");
  refuse([](TrackFrame& f) { f.landmarks_px.pop_back(); }, "1 landmarks; the header names 2");
  refuse([](TrackFrame& f) { f.extra["x"] = 1; }, "'x' has the name of a standard one");
  writer.write(tracked_frame(4));
  refuse([](TrackFrame&) {}, "comes after frame 4");
}

struct BadLine {
  const char* name;
  const char* from;
  const char* to;
  const char* message;
};

class TrackFileRejects : public ::testing::TestWithParam<BadLine> {};

TEST_P(TrackFileRejects, NamingTheLine) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "bad.jsonl";
  write_whole(path, 2);
  std::string text = read_text(path);
  const std::size_t at = text.rfind(GetParam().from);
  ASSERT_NE(at, std::string::npos);
  write_text(path, text.replace(at, std::string(GetParam().from).size(), GetParam().to));
  EXPECT_THAT([&] { read_track(path); },
              ThrowsMessage<InvalidInput>(AllOf(HasSubstr(path), HasSubstr(GetParam().message))));
}

INSTANTIATE_TEST_SUITE_P(
    All, TrackFileRejects,
    ::testing::Values(
        BadLine{"Schema", "track/1", "track/9", ":1: is not the header"},
        BadLine{"Parameters", "\"parameters\"", "\"paramters\"", ":1: 'parameters' is missing"},
        BadLine{"Frame", "\"frame\":1", "\"frame\":0", ":3: 'frame' must be a whole number above"},
        BadLine{"HugeFrame", "\"frame\":1", "\"frame\":99999999999", ":3: 'frame'"},
        BadLine{"Status", "\"tracked\"", "\"fine\"", ":3: 'status' must be"},
        BadLine{"X", "\"x\":[", "\"x\":[1,", ":3: 'x' must be an array of 8 numbers"},
        BadLine{"NullX", "\"x\":[-0.3333333333333333", "\"x\":[null", ":3: 'x' must hold numbers"},
        BadLine{"Pose", "\"translation_m\":[0.01,", "\"translation_m\":[", ":3: 'translation_m'"},
        BadLine{"Landmarks", "\"landmarks_px\":[[1.5,2.25],", "\"landmarks_px\":[",
                ":3: 'landmarks_px'"},
        BadLine{"Syntax", "\"status\":", "\"status\"", ":3: is not valid JSON"},
        BadLine{"BlankLine", "{\"frame\":1", "\n{\"frame\":1", ":3: is not valid JSON"}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(TrackCsv, HasARowPerFrameAndQuotesNames) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "track.jsonl", csv = folder.path() / "track.csv";
  write_whole(path, 3);
  write_track_csv(csv, read_track(path));
  const std::string text = read_text(csv);
  EXPECT_THAT(text, HasSubstr("frame,time_s,status,"));
  EXPECT_THAT(text, HasSubstr(",jaw_open [1],"));
  EXPECT_THAT(text, HasSubstr(",sigma jaw_open [1],"));
  EXPECT_THAT(text, HasSubstr(",\"nose, \"\"tip\"\"_x_px\","));
  const std::string lost = text.substr(text.rfind("\r\n", text.size() - 3) + 2);
  // 8 values, 8 sigmas, 7 of the pose, 2 figures and 4 of the landmarks are empty.
  EXPECT_EQ(lost, "2,0.08,lost" + std::string(29, ',') + "\r\n");
}

}  // namespace
}  // namespace semblance
