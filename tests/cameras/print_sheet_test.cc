// The files' shapes and scale, read back from the text of an SVG. That what is drawn can be read by
// the detectors is detect_test's.
#include "semblance/cameras/print_sheet.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "semblance/core/errors.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::HasSubstr;

constexpr double kMetresPerPoint = 0.0254 / 72.0;
constexpr double kGrid = 3e-6;  // cairo writes multiples of 1/256 point

std::string text_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

/// The rectangles of the path that is filled black, in metres on the page.
std::vector<BlackRectangle> filled_rectangles(const std::string& svg) {
  const std::size_t black = svg.find("fill:rgb(0%,0%,0%)");
  EXPECT_NE(black, std::string::npos);
  const std::size_t start = svg.find(" d=\"", black) + 4;
  std::vector<BlackRectangle> rectangles;
  std::stringstream words(svg.substr(start, svg.find('"', start) - start));
  std::string word;
  std::vector<double> numbers;
  while (words >> word) {
    if (word == "Z") {
      BlackRectangle r{{1e9, 1e9}, {-1e9, -1e9}};
      for (std::size_t i = 0; i + 1 < numbers.size(); i += 2) {
        const Eigen::Vector2d p = kMetresPerPoint * Eigen::Vector2d(numbers[i], numbers[i + 1]);
        r.lower_m = r.lower_m.cwiseMin(p);
        r.upper_m = r.upper_m.cwiseMax(p);
      }
      rectangles.push_back(r);
      numbers.clear();
    } else if (word != "M" && word != "L") {
      numbers.push_back(std::stod(word));
    }
  }
  return rectangles;
}

TEST(PrintSheet, TheSvgIsTrueToScale) {
  const testing::TemporaryFolder folder;
  const auto path = folder.path() / "sheet.svg";
  const Target target = parse_target("aprilgrid:5x6:0.027:0.3:border2");
  print_sheet(target, "a4", path.string());
  const std::string svg = text_of(path);
  EXPECT_THAT(svg, HasSubstr("width=\"595.275591pt\" height=\"841.889764pt\""));
  const std::vector<BlackRectangle> drawn = filled_rectangles(svg);
  const SheetShapes shapes = sheet_shapes(target);
  ASSERT_EQ(drawn.size(), shapes.rectangles.size());
  const Eigen::Vector2d shift = drawn[0].lower_m - shapes.rectangles[0].lower_m;
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    EXPECT_LT((drawn[i].lower_m - shift - shapes.rectangles[i].lower_m).norm(), kGrid);
    EXPECT_LT((drawn[i].upper_m - shift - shapes.rectangles[i].upper_m).norm(), kGrid);
  }
  // All of it lies on the paper, above the ruler.
  for (const BlackRectangle& r : drawn) {
    EXPECT_GT(r.lower_m.minCoeff(), 0.005 - kGrid);
    EXPECT_LT(r.upper_m.x(), 0.205 + kGrid);
    EXPECT_LT(r.upper_m.y(), 0.281);
  }
}

TEST(PrintSheet, SquaresOfAChessboardAlternateFromBlack) {
  const SheetShapes shapes = sheet_shapes(parse_target("chessboard:9x6:0.025"));
  EXPECT_EQ(shapes.rectangles.size(), 35u);  // of 10 x 7
  EXPECT_LT((shapes.rectangles[0].lower_m - Eigen::Vector2d(-0.025, -0.025)).norm(), 1e-12);
  EXPECT_LT((shapes.rectangles[0].upper_m).norm(), 1e-12);
}

TEST(PrintSheet, ThePdfHasThePapersSizeAndTheSameBytesEachTime) {
  const testing::TemporaryFolder folder;
  const auto a = folder.path() / "a.pdf", b = folder.path() / "b.pdf";
  const Target target = parse_target("dots:13x9:0.018");
  print_sheet(target, "letter", a.string());
  print_sheet(target, "letter", b.string());
  EXPECT_THAT(text_of(a), HasSubstr("/MediaBox [ 0 0 792 612 ]"));  // lying
  EXPECT_EQ(text_of(a), text_of(b));
}

TEST(PrintSheet, WhatDoesNotFitNamesThePaperThatWould) {
  const testing::TemporaryFolder folder;
  const auto path = folder.path() / "sheet.pdf";
  try {
    print_sheet(parse_target("chessboard:9x6:0.035"), "a4", path.string());
    ADD_FAILURE() << "it was printed";
  } catch (const InvalidInput& error) {
    EXPECT_THAT(error.what(), HasSubstr("--paper a3"));
  }
  EXPECT_THROW(print_sheet(parse_target("chessboard:9x6:1"), "a0", path.string()), InvalidInput);
  EXPECT_THROW(print_sheet(parse_target("auto"), "a4", path.string()), InvalidInput);
  EXPECT_THROW(print_sheet(parse_target("chessboard:9x6:0.02"), "b5", path.string()), InvalidInput);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
  const auto png = folder.path() / "sheet.png";
  EXPECT_THROW(print_sheet(parse_target("chessboard:9x6:0.02"), "a4", png.string()), InvalidInput);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace semblance
