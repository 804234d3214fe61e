// Circle grids and dot sheets: perspective moves the centres of ellipses, and with them the focal
// length, unless it is corrected.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "painted_sheet.h"
#include "semblance/cameras/board_calibration.h"
#include "semblance/cameras/rig_calibration.h"

namespace semblance {
namespace {

constexpr double kFocal_px = 704.0;  // of PaintedSheet at 640 x 480
constexpr int kViews = 10;

std::vector<Detection> painted_views(const Target& target) {
  std::vector<Detection> detections;
  for (int i = 0; i < kViews; ++i) {
    testing::SheetView view;
    view.tilt_rad = i == 0 ? 0.0 : 0.4 + 0.03 * i;
    view.axis_rad = 2.0 * std::numbers::pi * i / (kViews - 1);
    view.roll_rad = 0.1 * (i % 3 - 1);
    view.noise = 0.002;
    detections.push_back(detect(testing::PaintedSheet(target, view).paint(7), target));
  }
  return detections;
}

std::vector<Detection> without_radii(std::vector<Detection> detections) {
  for (Detection& detection : detections) detection.radii_px.clear();
  return detections;
}

/// How many of its deviations a focal length is off.
double focal_error(const Adjustment& adjustment) {
  return (adjustment.survey.cameras[0].focal_px.x() - kFocal_px) /
         std::sqrt(adjustment.covariance->cameras[0].intrinsics(0, 0));
}

class SheetCircles : public ::testing::TestWithParam<const char*> {};

TEST_P(SheetCircles, PerspectiveDoesNotReachTheFocalLength) {
  const std::vector<Detection> detections = painted_views(parse_target(GetParam()));
  std::vector<std::string> names;
  for (int i = 0; i < kViews; ++i) {
    names.push_back(std::string(1, static_cast<char>('a' + i)));
    ASSERT_EQ(detections[static_cast<std::size_t>(i)].radii_px.size(),
              detections[static_cast<std::size_t>(i)].ids.size());
  }
  const BoardOptions options{.lens = Lens::pinhole};
  const double plain =
      focal_error(calibrate_board(without_radii(detections), names, options).adjustment);
  const double corrected = focal_error(calibrate_board(detections, names, options).adjustment);
  EXPECT_LT(plain, -2.5);
  EXPECT_LT(std::abs(corrected), 2.5);
  EXPECT_LT(std::abs(corrected), 0.5 * std::abs(plain));

  // The same through a rig of one.
  std::vector<RigView> views;
  for (int i = 0; i < kViews; ++i) {
    views.push_back(
        {0, i, names[static_cast<std::size_t>(i)], detections[static_cast<std::size_t>(i)], {}});
  }
  const RigCalibration rig = calibrate_rig(views, {{.name = "camera"}}, {.lens = Lens::pinhole});
  EXPECT_LT(std::abs(focal_error(rig.adjustment)), 2.5);
}

INSTANTIATE_TEST_SUITE_P(Sheets, SheetCircles,
                         ::testing::Values("circles:4x11:0.02:asymmetric", "circles:7x5:0.04",
                                           "dots:13x9:0.02"));

}  // namespace
}  // namespace semblance
