#include "semblance/cameras/target.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/aruco/charuco.hpp>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using ::testing::HasSubstr;

TEST(Target, TextsAreReadAndWrittenBack) {
  for (const char* text :
       {"chessboard:9x6:0.025", "charuco:4x5:0.054:DICT_4X4_1000",
        "charuco:4x5:0.054:DICT_4X4_1000:0.04", "charuco:6x8:0.03:DICT_5X5_50:0.02:legacy",
        "aprilgrid:6x6:0.088:0.3", "aprilgrid:6x6:0.088:0.3:border2:first36",
        "circles:4x11:0.02:asymmetric", "circles:8x6:0.02", "dots:13x9:0.02", "auto",
        "auto:0.025"}) {
    EXPECT_EQ(target_text(parse_target(text)), text);
  }
}

TEST(Target, WhatIsNoSheetIsRefusedWithTheForms) {
  for (const char* text : {"",
                           "chess",
                           "chessboard",
                           "chessboard:9:0.02",
                           "chessboard:9x6",
                           "chessboard:9x6:0",
                           "chessboard:9x6:-1",
                           "chessboard:9x6:nan",
                           "chessboard:9x6:inf",
                           "chessboard:9x6:0.02:more",
                           "chessboard:1x6:0.02",
                           "chessboard:999999999x6:0.02",
                           "chessboard:9x6:1e999",
                           "charuco:4x5:0.05",
                           "charuco:4x5:0.05:DICT_9X9_1",
                           "charuco:4x5:0.05:DICT_4X4_50:0.06",
                           "charuco:20x20:0.05:DICT_4X4_50",
                           "aprilgrid:6x6:0.088",
                           "aprilgrid:6x6:0.088:0",
                           "aprilgrid:6x6:0.088:0.3:border3",
                           "aprilgrid:30x30:0.088:0.3",
                           "aprilgrid:6x6:0.088:0.3:first580",
                           "dots:3x3:0.02",
                           "auto:x",
                           "auto:1:2"}) {
    try {
      parse_target(text);
      ADD_FAILURE() << "read: " << text;
    } catch (const InvalidInput& error) {
      EXPECT_THAT(error.what(), HasSubstr("chessboard:9x6:0.025")) << text;
    }
  }
}

TEST(Target, CharucoPointsAndMarkersAreOpenCvs) {
  for (const int rows : {5, 6}) {
    Target target = parse_target("charuco:4x5:0.05:DICT_4X4_50:0.03");
    target.rows = rows;
    const auto board = cv::aruco::CharucoBoard::create(
        4, rows, 0.05f, 0.03f, cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_50));
    const std::vector<int> ids = point_ids(target);
    ASSERT_EQ(ids.size(), board->chessboardCorners.size());
    for (const int id : ids) {
      const cv::Point3f& corner = board->chessboardCorners[id];
      EXPECT_LT((point_on_sheet(target, id) - Eigen::Vector3d(corner.x, corner.y, 0)).norm(), 1e-7);
    }
  }
}

TEST(Target, TagsGrowUpwardsAsKalibrPrintsThem) {
  const Target target = parse_target("aprilgrid:3x2:0.1:0.5:first10");
  const std::vector<int> ids = point_ids(target);
  EXPECT_EQ(ids.front(), 40);
  EXPECT_EQ(ids.size(), 24u);
  // Tag 10 is in the lower left: its upper left corner is one pitch below the origin.
  EXPECT_LT((point_on_sheet(target, 43) - Eigen::Vector3d(0, 0.15, 0)).norm(), 1e-12);
  EXPECT_LT((point_on_sheet(target, 40) - Eigen::Vector3d(0, 0.25, 0)).norm(), 1e-12);
  EXPECT_LT((point_on_sheet(target, 41) - Eigen::Vector3d(0.1, 0.25, 0)).norm(), 1e-12);
  // Tag 15 is in the upper right.
  EXPECT_LT((point_on_sheet(target, 62) - Eigen::Vector3d(0.4, 0, 0)).norm(), 1e-12);
  EXPECT_EQ(point_name(target, 62), "tag 15, upper right");
}

TEST(Target, AsymmetricCirclesAreOpenCvs) {
  const Target target = parse_target("circles:4x11:0.02:asymmetric");
  for (int row = 0; row < 11; ++row) {
    for (int column = 0; column < 4; ++column) {
      const Eigen::Vector3d expected((2 * column + row % 2) * 0.02, row * 0.02, 0.0);
      EXPECT_LT((point_on_sheet(target, column + 4 * row) - expected).norm(), 1e-12);
    }
  }
}

TEST(Target, IdsThatTheSheetLacksAreRefused) {
  const Target target = parse_target("chessboard:9x6:0.025");
  EXPECT_THROW(point_on_sheet(target, 54), InvalidInput);
  EXPECT_THROW(point_on_sheet(target, -1), InvalidInput);
  EXPECT_THROW(point_name(target, 54), InvalidInput);
}

}  // namespace
}  // namespace semblance
