// Detectors on painted sheets, against the exact places of their points.
#include "semblance/cameras/detect.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "painted_sheet.h"

namespace semblance {
namespace {

using testing::PaintedSheet;
using testing::SheetView;

constexpr double kMargin = 9.0;  // px from the picture's border, inside which a point must be found

bool has_warning(const Detection& detection, DetectionWarning::Kind kind) {
  return std::any_of(detection.warnings.begin(), detection.warnings.end(),
                     [&](const DetectionWarning& w) { return w.kind == kind; });
}

/// Where the detector should see a point: for dots the centre of the ellipse.
Eigen::Vector2d truth_of(const PaintedSheet& sheet, const Target& target, int id) {
  const Eigen::Vector2d place = point_on_sheet(target, id).head<2>();
  for (const BlackDisc& disc : sheet.shapes().discs) {
    if ((disc.centre_m - place).norm() < 1e-9) return sheet.ellipse_centre(disc);
  }
  return sheet.project(place);
}

struct Errors {
  double rms_px = 0.0, worst_px = 0.0;
};

Errors errors_of(const PaintedSheet& sheet, const Detection& detection) {
  Errors errors;
  for (std::size_t i = 0; i < detection.ids.size(); ++i) {
    const double error = (detection.points_px.col(static_cast<Eigen::Index>(i)) -
                          truth_of(sheet, detection.target, detection.ids[i]))
                             .norm();
    errors.worst_px = std::max(errors.worst_px, error);
    errors.rms_px += error * error / static_cast<double>(detection.ids.size());
  }
  errors.rms_px = std::sqrt(errors.rms_px);
  return errors;
}

int visible_points(const PaintedSheet& sheet, const Target& target, const SheetView& view) {
  int count = 0;
  for (const int id : point_ids(target)) {
    const Eigen::Vector2d p = truth_of(sheet, target, id);
    count += p.minCoeff() > kMargin && p.x() < view.width - kMargin && p.y() < view.height - kMargin
                 ? 1
                 : 0;
  }
  return count;
}

/// Level, tilted by 45 degrees, tilted by 55 and turned by 130, nearly upside down, small.
std::vector<SheetView> plain_views() {
  SheetView level, tilted, steep, turned, small;
  tilted.tilt_rad = 0.78;
  tilted.axis_rad = 0.5;
  tilted.roll_rad = 0.3;
  steep.tilt_rad = 0.96;
  steep.axis_rad = 2.0;
  steep.roll_rad = 2.3;
  turned.tilt_rad = 0.3;
  turned.axis_rad = 1.0;
  turned.roll_rad = 3.1;
  small.fill = 0.5;
  small.roll_rad = 0.5;
  return {level, tilted, steep, turned, small};
}

class EverySheet : public ::testing::TestWithParam<const char*> {};

TEST_P(EverySheet, PointsAreWithinAFewHundredthsOfAPixel) {
  const Target target = parse_target(GetParam());
  Detector detector(target);
  for (const SheetView& view : plain_views()) {
    const PaintedSheet sheet(target, view);
    const Detection found = detector.detect(sheet.paint(1));
    EXPECT_GE(static_cast<int>(found.ids.size()), visible_points(sheet, target, view))
        << "tilt " << view.tilt_rad;
    const Errors errors = errors_of(sheet, found);
    EXPECT_LT(errors.rms_px, 0.035) << "tilt " << view.tilt_rad;
    EXPECT_LT(errors.worst_px, 0.12) << "tilt " << view.tilt_rad;
    EXPECT_TRUE(found.warnings.empty());
  }
}

INSTANTIATE_TEST_SUITE_P(Sheets, EverySheet,
                         ::testing::Values("chessboard:9x6:0.025", "charuco:8x6:0.03:DICT_5X5_100",
                                           "charuco:7x6:0.03:DICT_4X4_50:0.02:legacy",
                                           "aprilgrid:5x5:0.088:0.3",
                                           "aprilgrid:5x4:0.088:0.3:border2:first20",
                                           "circles:4x9:0.02:asymmetric", "dots:13x9:0.02"));

class CornerSheet : public ::testing::TestWithParam<const char*> {};

TEST_P(CornerSheet, DistortionAndBlurAreFollowed) {
  const Target target = parse_target(GetParam());
  Detector detector(target);
  SheetView barrel, strong, pincushion, blurred;
  for (SheetView* view : {&barrel, &strong, &pincushion, &blurred}) {
    view->tilt_rad = 0.25;
    view->roll_rad = 0.2;
    view->fill = 0.8;
  }
  barrel.distortion = -0.6;
  strong.distortion = -1.5;
  strong.fill = 1.0;
  pincushion.distortion = 0.5;
  blurred.blur_px = 2.0;
  for (const SheetView& view : {barrel, strong, pincushion, blurred}) {
    const PaintedSheet sheet(target, view);
    const Detection found = detector.detect(sheet.paint(2));
    EXPECT_GE(static_cast<int>(found.ids.size()), visible_points(sheet, target, view))
        << "distortion " << view.distortion;
    EXPECT_LT(errors_of(sheet, found).rms_px, 0.05) << "distortion " << view.distortion;
  }
}

INSTANTIATE_TEST_SUITE_P(Sheets, CornerSheet,
                         ::testing::Values("chessboard:9x6:0.025", "charuco:8x6:0.03:DICT_5X5_100",
                                           "aprilgrid:5x4:0.088:0.3:border2"));

class PartialSheet : public ::testing::TestWithParam<const char*> {};

TEST_P(PartialSheet, WhatIsSeenIsNamed) {
  const Target target = parse_target(GetParam());
  SheetView view;
  view.fill = 1.3;
  view.roll_rad = 0.4;
  view.tilt_rad = 0.4;
  view.shift_px = {70.0, 40.0};
  const PaintedSheet sheet(target, view);
  const Detection found = detect(sheet.paint(3), target);
  const int visible = visible_points(sheet, target, view);
  ASSERT_LT(visible, static_cast<int>(point_ids(target).size()));
  EXPECT_GE(static_cast<int>(found.ids.size()), visible * 95 / 100);
  EXPECT_LT(errors_of(sheet, found).rms_px, 0.05);
}

INSTANTIATE_TEST_SUITE_P(Sheets, PartialSheet,
                         ::testing::Values("charuco:8x6:0.03:DICT_5X5_100", "dots:13x9:0.02",
                                           "aprilgrid:5x4:0.088:0.3"));

Rgb8 mirrored(const Rgb8& image) {
  Rgb8 result = image;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const std::size_t from = 3 * (static_cast<std::size_t>(y) * image.width + x);
      const std::size_t to = 3 * (static_cast<std::size_t>(y) * image.width + image.width - 1 - x);
      std::copy_n(image.data.begin() + static_cast<std::ptrdiff_t>(from), 3,
                  result.data.begin() + static_cast<std::ptrdiff_t>(to));
    }
  }
  return result;
}

TEST(Detect, AMirroredSheetIsReportedAndNotMatched) {
  for (const char* text : {"charuco:8x6:0.03:DICT_5X5_100", "charuco:5x7:0.03:DICT_4X4_1000",
                           "aprilgrid:5x4:0.088:0.3", "dots:13x9:0.02"}) {
    const Target target = parse_target(text);
    SheetView view;
    view.tilt_rad = 0.3;
    const Detection found = detect(mirrored(PaintedSheet(target, view).paint(4)), target);
    EXPECT_FALSE(found.found()) << text;
    EXPECT_TRUE(has_warning(found, DetectionWarning::Kind::mirrored)) << text;
  }
}

TEST(Detect, WhiteOnBlackIsRecognised) {
  const Target target = parse_target("charuco:7x5:0.03:DICT_5X5_100");
  const PaintedSheet sheet(target, {});
  const Detection found = detect(sheet.paint(5, 0.75, 0.04), target);
  EXPECT_TRUE(found.inverted);
  EXPECT_EQ(found.ids.size(), point_ids(target).size());
  EXPECT_LT(errors_of(sheet, found).rms_px, 0.05);
}

TEST(Detect, WrongCountsAreNamed) {
  const PaintedSheet sheet(parse_target("chessboard:7x5:0.025"), {});
  const Detection found = detect(sheet.paint(6), parse_target("chessboard:9x6:0.025"));
  EXPECT_FALSE(found.found());
  ASSERT_TRUE(has_warning(found, DetectionWarning::Kind::wrong_counts));
  EXPECT_NE(found.warnings[0].text.find("7x5"), std::string::npos);
}

TEST(Detect, SheetsThatLookTheSameAfterHalfATurnSaySo) {
  for (const char* text : {"chessboard:8x6:0.025", "circles:8x6:0.02"}) {
    const Target target = parse_target(text);
    const PaintedSheet sheet(target, {});
    const Detection found = detect(sheet.paint(7), target);
    EXPECT_TRUE(has_warning(found, DetectionWarning::Kind::half_turn)) << text;
    EXPECT_LT(errors_of(sheet, found).rms_px, 0.05) << text;  // this one is upright
  }
}

TEST(Detect, APictureWithoutASheetHasNoPoints) {
  Random random(8);
  Rgb8 noise{320, 240, std::vector<std::uint8_t>(320 * 240 * 3)};
  for (auto& value : noise.data) value = static_cast<std::uint8_t>(random.integer(256));
  Rgb8 flat{320, 240, std::vector<std::uint8_t>(320 * 240 * 3, 128)};
  const Rgb8 tiny{3, 2, std::vector<std::uint8_t>(18, 0)};
  for (const char* text :
       {"chessboard:9x6:0.025", "charuco:8x6:0.03:DICT_4X4_50", "aprilgrid:5x4:0.088:0.3",
        "circles:4x11:0.02:asymmetric", "dots:13x9:0.02", "auto"}) {
    for (const Rgb8& image : {noise, flat, tiny}) {
      EXPECT_FALSE(detect(image, parse_target(text)).found()) << text << " " << image.width;
    }
  }
}

class AutoSheet : public ::testing::TestWithParam<const char*> {};

TEST_P(AutoSheet, IsRecognisedWithItsCounts) {
  const Target target = parse_target(GetParam());
  SheetView view;
  view.tilt_rad = 0.3;
  view.roll_rad = 0.2;
  view.width = 800;
  view.height = 600;
  const Rgb8 image = PaintedSheet(target, view).paint(9);
  const Target automatic = parse_target("auto:" + std::to_string(target.size_m));
  EXPECT_EQ(target_text(identify_target({image}, automatic)), GetParam());
  const Detection unsized = detect(image, parse_target("auto"));
  EXPECT_TRUE(has_warning(unsized, DetectionWarning::Kind::unknown_size));
  EXPECT_EQ(unsized.ids, point_ids(target));
}

INSTANTIATE_TEST_SUITE_P(Sheets, AutoSheet,
                         ::testing::Values("chessboard:9x6:0.025", "charuco:8x6:0.03:DICT_5X5_1000",
                                           "charuco:5x7:0.03:DICT_4X4_1000:0.018",
                                           "charuco:5x6:0.03:DICT_4X4_1000:legacy",
                                           "aprilgrid:6x5:0.088:0.3",
                                           "aprilgrid:5x4:0.088:0.3:border2",
                                           "circles:4x11:0.02:asymmetric", "circles:8x6:0.02",
                                           "dots:13x9:0.02"));

}  // namespace
}  // namespace semblance
