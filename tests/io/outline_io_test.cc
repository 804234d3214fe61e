#include "semblance/io/outline_io.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <Eigen/Geometry>

#include "files.h"
#include "semblance/core/errors.h"
#include "support.h"

namespace semblance {
namespace {

using Eigen::Matrix2Xd;
using Eigen::Vector2d;
using ::testing::HasSubstr;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;
using testing::write_text;

Matrix2Xd read(const std::string& name, const std::string& content, const std::string& id = "") {
  const TemporaryFolder folder;
  write_text(folder.path() / name, content);
  return read_outline(folder.path() / name, id);
}
Matrix2Xd path(const std::string& d) { return read("a.svg", "<svg><path d=\"" + d + "\"/></svg>"); }

TEST(Outline, TablesTakeCommasBlanksAndRemarks) {
  const Matrix2Xd p = read("a.csv", "# mm\n0,0\n1.5;-2\r\n3\t4\n\n0 0\n");
  EXPECT_EQ(p, (Matrix2Xd(2, 3) << 0, 1.5, 3, 0, -2, 4).finished());  // the repeated start is gone
}

TEST(Outline, SvgLinesAreExactWithYUp) {
  const Matrix2Xd expected = (Matrix2Xd(2, 4) << 1, 4, 4, 1, -2, -2, -6, -6).finished();
  EXPECT_EQ(path("M1,2 L4 2 4,6 1 6 Z"), expected);
  EXPECT_EQ(path("m1 2h3v4h-3z"), expected);
  EXPECT_EQ(path("M1 2H4V6L1,6"), expected);
  EXPECT_EQ(path("m1 2 3 0 0 4-3 0z"), expected);
  const std::string rect = "<rect x='1' y='2' width='3' height='4'/>";
  EXPECT_EQ(read("a.svg", "<svg>" + rect + "</svg>"), expected);
  EXPECT_EQ(read("a.svg", "<svg><polygon points='1,2 4,2 4,6 1,6'/></svg>"), expected);
}

TEST(Outline, SvgCurvesLieOnTheirClosedForms) {
  // Two half circles about (5, 0); one quadratic and its raised cubic; a cubic at a known place.
  const Matrix2Xd circle = path("M3 0 A2 2 0 0 1 7 0 A2 2 0 0 1 3 0 Z");
  ASSERT_GT(circle.cols(), 32);
  for (Eigen::Index i = 0; i < circle.cols(); ++i) {
    EXPECT_NEAR((circle.col(i) - Vector2d(5, 0)).norm(), 2.0, 1e-12);
  }
  EXPECT_GT(circle.row(1).maxCoeff(), 1.99);  // sweep 1 goes clockwise as seen: up first
  // A turned ellipse, all four arcs between two of its points.
  const Vector2d centre(5, 1), radii(3, 1);
  const Eigen::Matrix2d rotation = Eigen::Rotation2D<double>(M_PI / 6).toRotationMatrix();
  const auto place = [&](double angle) -> Vector2d {
    return centre + rotation * radii.cwiseProduct(Vector2d(std::cos(angle), std::sin(angle)));
  };
  const Vector2d start = place(0.3), end = place(2.0);
  for (const char* flags : {"0 1", "1 0"}) {  // the short way clockwise as seen, the long way back
    const Matrix2Xd arc =
        path(fmt::format("M{} {}A3 1 30 {} {} {}", start.x(), start.y(), flags, end.x(), end.y()));
    for (Eigen::Index i = 0; i < arc.cols(); ++i) {
      const Vector2d p(arc(0, i), -arc(1, i));
      EXPECT_NEAR((rotation.transpose() * (p - centre)).cwiseQuotient(radii).norm(), 1.0, 1e-9);
    }
    const Vector2d middle(arc(0, arc.cols() / 2), -arc(1, arc.cols() / 2));
    const double halfway = flags[0] == '0' ? 1.15 : 1.15 + M_PI;
    EXPECT_LT((middle - place(halfway)).norm(), 0.2);
  }
  const Matrix2Xd quadratic = path("M0 0 Q1 2 2 0 T4 0 Z"),
                  cubic = path("M0 0 C1 3 2 3 3 0 S5 -3 6 0 Z");
  EXPECT_NEAR(quadratic(0, 16), 1.0, 1e-12);
  EXPECT_NEAR(quadratic(1, 16), -1.0, 1e-12);
  EXPECT_NEAR(quadratic(1, 48), 1.0, 1e-12);  // T mirrors the handle
  EXPECT_NEAR(cubic(1, 16), -2.25, 1e-12);    // 3/4 of the handles' height
  EXPECT_NEAR(cubic(1, 48), 2.25, 1e-12);     // S too
}

TEST(Outline, SvgTransformsApplyFromInsideOut) {
  const Matrix2Xd p = read("a.svg",
                           "<svg><g transform='translate(10,0) rotate(90)'><polygon "
                           "transform='scale(2)' points='1,0 0,1 1,1'/></g></svg>");
  // (1,0) -> (2,0) -> (0,2) -> (10,2); y up.
  EXPECT_LT((p.col(0) - Vector2d(10, -2)).norm(), 1e-12);
  EXPECT_LT((p.col(1) - Vector2d(8, 0)).norm(), 1e-12);
}

TEST(Outline, SvgShapesAreChosenByTheirId) {
  const std::string two = "<svg><circle id='a' r='1'/><circle id='b' r='2'/></svg>";
  EXPECT_NEAR(read("a.svg", two, "b").colwise().norm().maxCoeff(), 2.0, 1e-12);
  EXPECT_THROW(read("a.svg", two), InvalidInput);
}

struct Bad {
  const char* file;
  const char* content;
  const char* message;
};

TEST(Outline, RejectsWithAMessage) {
  const Bad cases[] = {
      {"a.csv", "", "the contour is empty"},
      {"a.csv", "0 0\n1 x\n", "a.csv:2: '1 x' is not a point"},
      {"a.csv", "0 0\n1 nan\n", "is not a point"},
      {"a.csv", "0 0 0\n", "is not a point"},
      {"a.svg", "not a drawing", "not an SVG drawing"},
      {"a.svg", "<svg></svg>", "0 shapes"},
      {"a.svg", "<svg><path id='p' d='M0 0 L1'/></svg>",
       "'path' 'p': a number expected before the end"},
      {"a.svg", "<svg><path d='L0 0'/></svg>", "begins with M"},
      {"a.svg", "<svg><path d='M0 0 L1 1 X 2 2'/></svg>", "a path command"},
      {"a.svg", "<svg><path d='M0 0h1v1z m5 5h1v1z'/></svg>", "several parts"},
      {"a.svg", "<svg><path d='M0 0 1e999 0'/></svg>", "a number expected"},
      {"a.svg", "<svg><path transform='bend(3)' d='M0 0h1v1z'/></svg>", "transform 'bend'"},
      {"a.stl", "", ".csv, .txt or .svg"}};
  for (const Bad& bad : cases) {
    EXPECT_THAT(
        [&] { read(bad.file, bad.content); },
        ThrowsMessage<InvalidInput>(::testing::AllOf(HasSubstr(bad.file), HasSubstr(bad.message))))
        << bad.content;
  }
}

}  // namespace
}  // namespace semblance
