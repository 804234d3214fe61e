#include "semblance/io/range_map_io.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "semblance/core/errors.h"
#include "semblance/io/image_io.h"
#include "semblance/io/video.h"
#include "support.h"

namespace semblance {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

RangeMap make_map() {
  RangeMap map;
  map.spacing_m = 0.001;
  map.bottom_m = -0.25;
  map.world_from_map = Rigid3{quaternion_from_rotation_vector({0.1, 2.0, -0.4}), {0.5, 1.0, -2.0}};
  map.radius_m = Grid::NullaryExpr(7, 5, [](Eigen::Index row, Eigen::Index column) {
    return 0.05f + 0.0123f * static_cast<float>(row) + 0.0017f * static_cast<float>(column);
  });
  map.samples = RangeMap::Samples::Constant(7, 5, RangeSample::measured);
  map.samples(6, 1) = RangeSample::filled;
  map.samples(0, 3) = RangeSample::none;
  map.radius_m(0, 3) = 0.0f;
  return map;
}

class RangeMapIo : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
  nlohmann::json header() const {
    std::ifstream file(path("scan.json"));
    return nlohmann::json::parse(file);
  }
  void write_header(const nlohmann::json& json) const {
    std::ofstream(path("scan.json")) << json.dump();
  }
  void expect_rejected(const char* text) const {
    EXPECT_THAT([&] { read_range_map(path("scan.json")); },
                ThrowsMessage<InvalidInput>(AllOf(HasSubstr("scan"), HasSubstr(text))));
  }

  testing::TemporaryFolder folder_;
};

TEST_F(RangeMapIo, ReadsWhatItWrote) {
  const RangeMap map = make_map();
  for (const RangeEncoding encoding : {RangeEncoding::png16, RangeEncoding::exr}) {
    write_range_map(path("scan.json"), map, encoding);
    const RangeMap read = read_range_map(path("scan.json"));
    const float step = map.radius_m.maxCoeff() / 65535.0f;
    const float tolerance = encoding == RangeEncoding::exr ? 0.0f : 0.501f * step;
    EXPECT_LE((read.radius_m - map.radius_m).abs().maxCoeff(), tolerance);
    EXPECT_TRUE((read.samples == map.samples).all());
    EXPECT_EQ(read.bottom_m, map.bottom_m);
    EXPECT_EQ(read.spacing_m, map.spacing_m);
    EXPECT_LT((read.point(3, 2) - map.point(3, 2)).norm(), 2.0 * tolerance + 1e-12);
  }
  EXPECT_TRUE(fs::exists(path("scan.exr")));
}

TEST_F(RangeMapIo, ReadsWhatItWroteOfExtremeRadii) {
  RangeMap map = make_map();
  map.radius_m(2, 2) = 1e-9f;                                    // far below a step
  map.radius_m(0, 3) = std::numeric_limits<float>::quiet_NaN();  // void: no meaning
  write_range_map(path("scan.json"), map, RangeEncoding::png16);
  const RangeMap read = read_range_map(path("scan.json"));
  const float step = 0.1306f / 65535.0f;  // of the largest radius, in row 6 and column 4
  EXPECT_NEAR(read.radius_m(2, 2), step, 1e-3f * step);
  EXPECT_NEAR(read.radius_m(6, 4), map.radius_m(6, 4), 1e-7f);
  EXPECT_TRUE((read.samples == map.samples).all());
}

TEST_F(RangeMapIo, PicturesStartAtTheTop) {
  write_range_map(path("scan.json"), make_map(), RangeEncoding::png16);
  const Rgb8 marks = read_image_rgb8(path("scan_samples.png"));
  EXPECT_EQ(marks.data[3 * (0 * 5 + 1)], 128);  // row 6, column 1
  EXPECT_EQ(marks.data[3 * (6 * 5 + 3)], 0);    // row 0, column 3
  EXPECT_EQ(marks.data[0], 255);
}

TEST_F(RangeMapIo, RejectsHeadersThatDoNotFit) {
  write_range_map(path("scan.json"), make_map(), RangeEncoding::png16);
  const nlohmann::json good = header();
  const auto reject = [&](const char* key, const nlohmann::json& value, const char* text) {
    nlohmann::json bad = good;
    bad[key] = value;
    write_header(bad);
    expect_rejected(text);
  };
  reject("rows", 8, "header says");
  reject("rows", 0, "\"rows\"");
  reject("columns", 2.5, "\"columns\"");
  reject("columns", "5", "\"columns\"");
  reject("spacing_m", -1, "spacing_m");
  reject("rotation_wxyz", {1, 1, 0, 0}, "length 1");
  reject("rotation_wxyz", {1, 0, 0}, "list of 4");
  reject("radius_step_m", 0, "radius_step_m");
  reject("radius_encoding", "tiff", "png16");
  reject("radius_encoding", "exr", "OpenEXR");
  reject("radius_file", "../scan.png", "own folder");
  reject("schema", "semblance.track/1", "schema");
  nlohmann::json bad = good;
  bad.erase("samples_file");
  write_header(bad);
  expect_rejected("\"samples_file\" is missing");
  write_header(good);
  EXPECT_NO_THROW(read_range_map(path("scan.json")));
}

TEST_F(RangeMapIo, RejectsPicturesThatDoNotFit) {
  RangeMap map = make_map();
  write_range_map(path("scan.json"), map, RangeEncoding::png16);
  fs::copy_file(path("scan_samples.png"), path("scan.png"), fs::copy_options::overwrite_existing);
  expect_rejected("16 bits");
  fs::remove(path("scan.png"));
  EXPECT_THROW(read_range_map(path("scan.json")), IoError);
}

TEST_F(RangeMapIo, RejectsRadiiThatAreNone) {
  RangeMap map = make_map();
  map.samples.setConstant(RangeSample::none);
  EXPECT_THROW(write_range_map(path("scan.json"), map, RangeEncoding::png16), InvalidInput);
  EXPECT_TRUE(fs::is_empty(folder_.path()));
  // A header whose step makes every radius infinite.
  map = make_map();
  write_range_map(path("scan.json"), map, RangeEncoding::png16);
  nlohmann::json json = header();
  json["radius_step_m"] = 1e38;
  write_header(json);
  expect_rejected("finite positive");
  // A measured sample of an OpenEXR picture that is not a number.
  write_range_map(path("scan.json"), map, RangeEncoding::exr);
  cv::Mat picture = cv::imread(path("scan.exr"), cv::IMREAD_UNCHANGED);
  picture.at<float>(0, 0) = std::numeric_limits<float>::quiet_NaN();
  cv::imwrite(path("scan.exr"), picture);
  expect_rejected("row 6 and column 0");
}

}  // namespace
}  // namespace semblance
