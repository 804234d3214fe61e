#include "semblance/pipeline/report.h"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "report_chart.h"
#include "semblance/core/errors.h"
#include "semblance/core/random.h"
#include "semblance/core/rigid3.h"
#include "semblance/core/version.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

nlohmann::json header_with(const std::vector<std::string>& names) {
  nlohmann::json header = {{"schema", "semblance.track/1"},
                           {"program", "semblance 0.1.0"},
                           {"kind", "face"},
                           {"seed", 3},
                           {"frame_size", {400, 300}},
                           {"parameters", nlohmann::json::array()},
                           {"config", {{"optimizer", "lm"}}}};
  for (const auto& name : names) header["parameters"].push_back({{"name", name}, {"unit", "1"}});
  return header;
}

const std::vector<std::string> names{"rotation[0]",    "rotation[1]",    "rotation[2]",
                                     "rotation[3]",    "translation[0]", "translation[1]",
                                     "translation[2]", "jaw_open",       "eye_blink_left"};

TrackFrame frame_at(int index, TrackStatus status) {
  TrackFrame frame;
  frame.frame = index;
  frame.time_s = index * 0.04;
  frame.status = status;
  if (status == TrackStatus::lost) return frame;
  const double t = frame.time_s;
  const Eigen::Quaterniond q =
      quaternion_from_rotation_vector({0.1 * std::sin(t), 0.5 * std::sin(0.3 * t), 0.02});
  frame.rotation_wxyz << q.w(), q.x(), q.y(), q.z();
  frame.translation_m << 0.01 * t, 0.0, -0.5;
  frame.x.resize(9);
  frame.x << frame.rotation_wxyz, frame.translation_m, std::abs(std::sin(2.0 * t)), 0.1;
  frame.sigma = Eigen::VectorXd::Constant(9, 0.003);
  frame.residual_rms = 0.03 + 0.001 * (index % 17);
  frame.inlier_fraction = 0.9;
  frame.landmarks_px = {{150.0, 120.0}, {250.0, 120.0}, {200.0, 220.0}};
  return frame;
}

Rgb8 noise_picture(int width, int height, std::uint64_t seed) {
  Random random(seed);
  Rgb8 picture{width, height, {}};
  for (int i = 0; i < width * height * 3; ++i)
    picture.data.push_back(static_cast<std::uint8_t>(128 + 24 * random.uniform()));
  return picture;
}

ReportInput example(int frames) {
  ReportInput input;
  input.title = "clip.mp4";
  input.track.header = header_with(names);
  for (int i = 0; i < frames; ++i) {
    const bool lost = i >= 3 && i <= 5;
    input.track.frames.push_back(frame_at(i, lost     ? TrackStatus::lost
                                             : i == 6 ? TrackStatus::reinitialised
                                                      : TrackStatus::tracked));
  }
  input.stages = {{"decode", 0.2}, {"track", 1.5}};
  input.wall_s = 2.0;
  return input;
}

std::string written(const ReportInput& input) {
  const testing::TemporaryFolder folder;
  const std::string path = (folder.path() / "report.html").string();
  write_report(path, input);
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// Empty if every element is closed in order, else what is wrong. Understands what XML does.
std::string tag_error(const std::string& html) {
  std::vector<std::string> open;
  for (std::size_t at = html.find('<'); at != std::string::npos; at = html.find('<', at)) {
    const std::size_t end = html.find('>', at);
    if (end == std::string::npos) return "unfinished tag";
    const std::string tag = html.substr(at + 1, end - at - 1);
    at = end;
    if (tag.find('<') != std::string::npos) return "stray < before " + tag;
    if (tag.starts_with("!") || tag.ends_with("/")) continue;
    if (std::count(tag.begin(), tag.end(), '"') % 2 != 0) return "unbalanced quotes in " + tag;
    const std::string name = tag.substr(tag[0] == '/', tag.find_first_of(" \n") - (tag[0] == '/'));
    if (tag[0] != '/') {
      open.push_back(name);
    } else {
      if (open.empty() || open.back() != name) return "unexpected </" + name + ">";
      open.pop_back();
    }
  }
  return open.empty() ? "" : "unclosed <" + open.back() + ">";
}

std::size_t count_of(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1))
    ++count;
  return count;
}

TEST(Report, IsWellFormedAndComplete) {
  ReportInput input = example(60);
  for (const TrackFrame& frame : input.track.frames)
    input.pictures.add(noise_picture(80, 60, 1), frame);
  const std::string html = written(input);
  EXPECT_EQ(tag_error(html), "");
  EXPECT_THAT(html, HasSubstr("95.0 %"));  // 57 of 60
  EXPECT_THAT(html, HasSubstr("57 of 60 frames with an estimate"));
  EXPECT_THAT(html, HasSubstr("frames lost, in 1 span<"));
  EXPECT_THAT(html, HasSubstr("frames 3 to 5 (0.12 to 0.20 s)"));
  EXPECT_THAT(html, HasSubstr("30.0/s"));
  EXPECT_THAT(html, HasSubstr("jaw_open"));
  EXPECT_THAT(html, HasSubstr("<td>optimizer</td><td>lm</td>"));
  EXPECT_THAT(html, HasSubstr(program_version()));
}

TEST(Report, RefersToNothingOutside) {
  ReportInput input = example(40);
  for (const TrackFrame& frame : input.track.frames)
    input.pictures.add(noise_picture(80, 60, 1), frame);
  const std::string html = written(input);
  EXPECT_THAT(html, Not(HasSubstr("http")));
  EXPECT_THAT(html, Not(HasSubstr("href")));
  EXPECT_THAT(html, Not(HasSubstr("@import")));
  EXPECT_THAT(html, Not(HasSubstr("file:")));
  EXPECT_GT(count_of(html, "src="), 0u);
  EXPECT_EQ(count_of(html, "src="), count_of(html, "src=\"data:image/jpeg;base64,"));
  EXPECT_EQ(count_of(html, "url("), count_of(html, "url(#lost)"));
}

TEST(Report, EscapesEveryText) {
  const std::string nasty = "<script>alert(\"1\")</script>&'";
  ReportInput input = example(10);
  input.title = nasty;
  input.track.header["kind"] = nasty;
  input.track.header["config"][nasty] = nasty;
  input.track.header["frame_size"] = {nasty, nasty};
  input.track.header["parameters"][7]["name"] = "jaw_open" + nasty;
  input.track.header["parameters"][8]["unit"] = nasty;
  input.stages.push_back({nasty, 1.0});
  const std::string html = written(input);
  EXPECT_EQ(tag_error(html), "");
  EXPECT_EQ(count_of(html, "<script>"), 1u);  // the page's own
  EXPECT_THAT(html, HasSubstr("&lt;script&gt;alert(&quot;1&quot;)&lt;/script&gt;&amp;&#39;"));
}

TEST(Report, StaysSmall) {
  ReportInput input = example(1337);
  input.pictures = ContactSheet(400);
  const Rgb8 picture = noise_picture(800, 600, 1);
  for (const TrackFrame& frame : input.track.frames) input.pictures.add(picture, frame);
  const std::size_t size = written(input).size();
  EXPECT_LT(size, 2'000'000u);
  ReportInput longer = example(30000);
  EXPECT_LT(written(longer).size(), 1'000'000u);  // without pictures
}

TEST(Report, WritesATrackWithoutEstimates) {
  ReportInput input = example(0);
  EXPECT_EQ(tag_error(written(input)), "");
  for (int i = 0; i < 5; ++i) input.track.frames.push_back(frame_at(i, TrackStatus::lost));
  const std::string html = written(input);
  EXPECT_EQ(tag_error(html), "");
  EXPECT_THAT(html, HasSubstr("0 of 5 frames"));
  EXPECT_THAT(html, Not(HasSubstr("nan")));
}

TEST(Report, RefusesFramesThatDoNotFitTheHeader) {
  ReportInput input = example(10);
  input.track.frames[8].x.conservativeResize(5);
  EXPECT_THROW(written(input), InvalidInput);
}

TEST(HeadAngles, InvertTheStatedProduct) {
  Random random(5);
  for (int i = 0; i < 200; ++i) {
    const double yaw = random.uniform(-3.0, 3.0), pitch = random.uniform(-1.4, 1.4),
                 roll = random.uniform(-3.0, 3.0);
    const Eigen::Quaterniond q = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()) *
                                 Eigen::AngleAxisd(-pitch, Eigen::Vector3d::UnitX()) *
                                 Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ());
    const Eigen::Vector3d found = head_angles({q.w(), q.x(), q.y(), q.z()});
    EXPECT_LT((found - Eigen::Vector3d(yaw, pitch, roll)).norm(), 1e-9);
  }
}

TEST(HeadAngles, SignsAreThoseOfTheText) {
  // Nose along +x in the world: the face's own left. Nose up: +y. Crown to -x: its right shoulder.
  const auto angles = [](double angle, const Eigen::Vector3d& axis) {
    const Eigen::Quaterniond q(Eigen::AngleAxisd(angle, axis));
    return head_angles({q.w(), q.x(), q.y(), q.z()});
  };
  const Eigen::Quaterniond left = Eigen::Quaterniond::FromTwoVectors(
      Eigen::Vector3d::UnitZ(), Eigen::Vector3d(0.3, 0, 1).normalized());
  EXPECT_GT(head_angles({left.w(), left.x(), left.y(), left.z()})[0], 0.1);
  const Eigen::Quaterniond up = Eigen::Quaterniond::FromTwoVectors(
      Eigen::Vector3d::UnitZ(), Eigen::Vector3d(0, 0.3, 1).normalized());
  EXPECT_GT(head_angles({up.w(), up.x(), up.y(), up.z()})[1], 0.1);
  const Eigen::Vector3d crown =
      Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()) * Eigen::Vector3d::UnitY();
  EXPECT_LT(crown.x(), 0.0);
  EXPECT_GT(angles(0.3, Eigen::Vector3d::UnitZ())[2], 0.1);
}

TEST(HeadAngles, DeviationsAgreeWithSampling) {
  const Eigen::Quaterniond q =
      quaternion_from_rotation_vector({0.3, 0.7, -0.2}) * Eigen::Quaterniond::Identity();
  const Eigen::Vector4d centre(q.w(), q.x(), q.y(), q.z());
  const Eigen::Vector4d sigma(0.001, 0.003, 0.002, 0.0015);
  const Eigen::Vector3d mean = head_angles(centre);
  Eigen::Vector3d square = Eigen::Vector3d::Zero();
  Random random(11);
  constexpr int k_samples = 40000;
  for (int i = 0; i < k_samples; ++i) {
    const Eigen::Vector4d noise = random.normal_vector(4);
    square += (head_angles(centre + sigma.cwiseProduct(noise)) - mean).cwiseAbs2() / k_samples;
  }
  const Eigen::Vector3d stated = head_angles_sigma(centre, sigma);
  for (int axis = 0; axis < 3; ++axis)  // the spread of a sampled deviation is 1 / sqrt(2 n)
    EXPECT_NEAR(stated[axis] / std::sqrt(square[axis]), 1.0, 5.0 / std::sqrt(2.0 * k_samples));
}

TEST(KeepExtremes, KeepsThoseOfEveryPart) {
  Random random(2);
  for (const std::size_t n : {1u, 7u, 100u, 1337u}) {
    std::vector<double> values(n);
    for (double& v : values) v = random.uniform() < 0.1 ? NAN : random.normal();
    for (const std::size_t buckets : {1u, 10u, 480u, 5000u}) {
      const auto kept = keep_extremes(values, buckets);
      EXPECT_TRUE(std::is_sorted(kept.begin(), kept.end()));
      EXPECT_LE(kept.size(), 2 * std::min(buckets, n));
      const std::size_t parts = std::min(buckets, n);
      for (std::size_t b = 0; b < parts; ++b) {
        double least = INFINITY, greatest = -INFINITY, kept_least = INFINITY,
               kept_greatest = -INFINITY;
        for (std::size_t i = b * n / parts; i < (b + 1) * n / parts; ++i) {
          if (!std::isfinite(values[i])) continue;
          least = std::min(least, values[i]);
          greatest = std::max(greatest, values[i]);
          if (!std::binary_search(kept.begin(), kept.end(), i)) continue;
          kept_least = std::min(kept_least, values[i]);
          kept_greatest = std::max(kept_greatest, values[i]);
        }
        EXPECT_EQ(kept_least, least);
        EXPECT_EQ(kept_greatest, greatest);
      }
    }
  }
}

TEST(Chart, ShowsASpikeOfOneFrameInALongClip) {
  std::vector<TrackFrame> frames;
  for (int i = 0; i < 20000; ++i) frames.push_back(frame_at(i, TrackStatus::tracked));
  Series series{"blink", "", std::vector<double>(20000, 0.0), {}, "#000000", {{0.0, 1.0}}};
  series.values[12345] = 1.0;
  const std::string svg = chart_svg(series, TimeAxis(frames), 1040, 118);
  // The plot starts 24 pixels down, and its right end is the last frame's.
  const double x = 46.0 + (12345 + 0.5) / 20000.0 * (1040 - 46 - 8);
  std::ostringstream point;
  point.precision(1);
  point << std::fixed << x << ",24.0";
  EXPECT_THAT(svg, HasSubstr(point.str()));
}

TEST(Chart, BreaksCurveAndBandWhereLost) {
  std::vector<TrackFrame> frames;
  for (int i = 0; i < 300; ++i)
    frames.push_back(frame_at(i, i / 100 == 1 ? TrackStatus::lost : TrackStatus::tracked));
  Series series{"yaw", "degrees", {}, {}, "#000000", {}};
  for (int i = 0; i < 300; ++i) {
    series.values.push_back(i / 100 == 1 ? NAN : std::sin(0.1 * i));
    series.sigma.push_back(i < 50 ? NAN : 0.1);
  }
  const std::string svg = chart_svg(series, TimeAxis(frames), 1040, 118);
  EXPECT_EQ(count_of(svg, "<polyline"), 2u);
  EXPECT_EQ(count_of(svg, "<polygon"), 2u);
  EXPECT_EQ(count_of(svg, "fill=\"url(#lost)\""), 1u);
}

TEST(ContactSheet, KeepsTheWorstTheChangesAndAnEvenChoice) {
  ContactSheet sheet(80);
  const int worst_frame = 431;
  for (int i = 0; i < 1000; ++i) {
    TrackFrame frame = frame_at(i, i >= 700 && i < 720 ? TrackStatus::lost
                                   : i == 720          ? TrackStatus::reinitialised
                                                       : TrackStatus::tracked);
    frame.residual_rms = 0.02 + 0.01 * std::sin(0.05 * i) + (i == worst_frame ? 0.1 : 0.0);
    sheet.add(noise_picture(80, 60, 1), frame);
  }
  const auto worst = sheet.worst();
  ASSERT_EQ(worst.size(), 12u);
  EXPECT_EQ(worst[0].frame, worst_frame);
  for (std::size_t i = 0; i < worst.size(); ++i)
    for (std::size_t k = 0; k < i; ++k)
      EXPECT_GE(std::abs(worst[i].frame - worst[k].frame), ContactSheet::k_passage_frames / 2);
  const auto spaced = sheet.spaced();
  ASSERT_GE(spaced.size(), 12u);
  ASSERT_LE(spaced.size(), 24u);
  const int stride = spaced[1].frame - spaced[0].frame;
  for (std::size_t i = 0; i < spaced.size(); ++i)
    EXPECT_EQ(spaced[i].frame, static_cast<int>(i) * stride);
  EXPECT_GE(spaced.back().frame + stride, 1000);
  const auto changes = sheet.changes();
  ASSERT_EQ(changes.size(), 2u);
  EXPECT_EQ(changes[0].frame, 700);
  EXPECT_EQ(changes[1].frame, 720);
}

}  // namespace
}  // namespace semblance
