#include "semblance/geometry/planar_contour.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Matrix2Xd;
using Eigen::Vector2d;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double two_pi = 2.0 * std::numbers::pi;

Matrix2Xd random_points(int count, unsigned seed) {
  std::srand(seed);
  return Matrix2Xd::Random(2, count);
}

TEST(PlanarContour, PassesItsPointsWithWeightsThatGiveItBack) {
  for (const ContourKind kind : {ContourKind::polygon, ContourKind::smooth}) {
    const PlanarContour c(random_points(9, 3), kind);
    for (int k = 0; k < 9; ++k) {
      EXPECT_LT((c.at(two_pi * k / 9).point - c.points().col(k)).norm(), 1e-12);
    }
    for (const double u : {-1.0, 0.3, 2.0, 5.9, 7.5}) {
      const auto w = c.weights(u);
      EXPECT_LT((c.points() * w.value - c.at(u).point).norm(), 1e-12);
      EXPECT_LT((c.points() * w.slope - c.at(u).tangent).norm(), 1e-11);
      const double h = 1e-6;
      const Vector2d difference = (c.at(u + h).point - c.at(u - h).point) / (2 * h);
      EXPECT_LT((c.at(u).tangent - difference).norm(), 1e-7);
    }
  }
}

TEST(NamedOutline, HasTheStatedSize) {
  EXPECT_NEAR(named_outline("circle", 0.3).colwise().norm().maxCoeff(), 0.3, 1e-15);
  EXPECT_NEAR(named_outline("square", 0.3).cwiseAbs().maxCoeff(), 0.3, 1e-15);
  EXPECT_NEAR(named_outline("square", 0.3).colwise().norm().maxCoeff(), 0.3 * std::sqrt(2.0),
              1e-12);
  EXPECT_THAT([] { named_outline("star", 1.0); },
              ThrowsMessage<InvalidInput>(HasSubstr("circle, square, wave and ellipse")));
}

TEST(RequireSimple, NamesTheDefect) {
  const auto message = [](const Matrix2Xd& p, const char* expected) {
    EXPECT_THAT([&] { require_simple(p, "a.csv"); }, ThrowsMessage<InvalidInput>(::testing::AllOf(
                                                         HasSubstr("a.csv"), HasSubstr(expected))));
  };
  message(Matrix2Xd(2, 0), "empty");
  message(Matrix2Xd::Constant(2, 4, NAN), "finite");
  message((Matrix2Xd(2, 3) << 0, 1, 0, 0, 0, 0).finished(), "different points");
  message((Matrix2Xd(2, 4) << 0, 1, 1, 0, 0, 1, 0, 1).finished(),
          "its sides after points 1 and 3 meet");
  // A circle whose points are not in order.
  Matrix2Xd circle = named_outline("circle", 1.0, 32);
  circle.col(5).swap(circle.col(20));
  message(circle, "crosses itself");
  message((Matrix2Xd(2, 3) << 0, 1, 2, 0, 1, 2).finished(), "encloses no area");  // folded flat
  EXPECT_NO_THROW(require_simple(named_outline("wave", 1.0, 200), "wave"));
}

// Brute force over all pairs of segments, by the parameters of their crossing.
bool crosses(const Matrix2Xd& p) {
  const Eigen::Index n = p.cols();
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = i + 2; j < n; ++j) {
      if (i == 0 && j == n - 1) continue;
      const Vector2d a = p.col(i), c = p.col(j), r = p.col((i + 1) % n) - a,
                     s = p.col((j + 1) % n) - c;
      const double d = r.x() * s.y() - r.y() * s.x();
      const Vector2d w = c - a;
      const double t = (w.x() * s.y() - w.y() * s.x()) / d, q = (w.x() * r.y() - w.y() * r.x()) / d;
      if (t >= 0 && t <= 1 && q >= 0 && q <= 1) return true;
    }
  }
  return false;
}

TEST(RequireSimple, AgreesWithBruteForce) {
  int found = 0;
  for (unsigned seed = 1; seed <= 200; ++seed) {
    const Matrix2Xd p = random_points(5, seed);
    bool thrown = false;
    try {
      require_simple(p, "random");
    } catch (const InvalidInput&) {
      thrown = true;
    }
    EXPECT_EQ(thrown, crosses(p)) << seed;
    found += thrown;
  }
  EXPECT_GT(found, 50);
  EXPECT_LT(found, 190);
}

TEST(Correspond, PolarMeetsTheRays) {
  // A square given by its corners alone, clockwise.
  const Matrix2Xd square = (Matrix2Xd(2, 4) << 1, 1, -1, -1, 1, -1, -1, 1).finished();
  const auto c = correspond({square, named_outline("wave", 2.0, 999)}, Correspondence::polar, 64);
  for (int k = 0; k < 64; ++k) {
    const double u = two_pi * k / 64;
    const Vector2d ray(std::cos(u), std::sin(u));
    EXPECT_LT((c[0].col(k) - ray / ray.cwiseAbs().maxCoeff()).norm(), 1e-12);
    EXPECT_NEAR(std::atan2(c[1](1, k), c[1](0, k)), std::atan2(ray.y(), ray.x()), 1e-12);
    EXPECT_NEAR(c[1].col(k).norm(), 2.0 * (1.0 + 0.15 * std::cos(8.0 * u)), 1e-3);
  }
}

TEST(Correspond, PolarRefusesWhatIsNotStarShaped) {
  Matrix2Xd beside = named_outline("circle", 1.0);
  beside.row(0).array() += 3.0;
  EXPECT_THAT([&] { correspond({beside}, Correspondence::polar, 32); },
              ThrowsMessage<InvalidInput>(
                  ::testing::AllOf(HasSubstr("contour 1"), HasSubstr("arc_length or matched"))));
}

TEST(Correspond, ArcLengthFindsATurnedCopy) {
  const Matrix2Xd ellipse = named_outline("ellipse", 1.0, 720);
  // The same points, started elsewhere, in the other direction, and moved.
  Matrix2Xd other(2, 720);
  for (int k = 0; k < 720; ++k) other.col(k) = ellipse.col((1000 - k) % 720) + Vector2d(0.3, 0.1);
  const auto c = correspond({ellipse, other}, Correspondence::arc_length, 180);
  // Starts are found among 180 places: at most half a step (2 degrees) off.
  EXPECT_LT(((c[1] - c[0]).colwise() - Vector2d(0.3, 0.1)).colwise().norm().maxCoeff(), 0.02);
}

TEST(Correspond, MatchedKeepsCornersTogetherWhereLengthDoesNot) {
  // Two L-shaped outlines with arms of other lengths: corners belong to corners.
  const Matrix2Xd a = (Matrix2Xd(2, 6) << 0, 3, 3, 1, 1, 0, 0, 0, 1, 1, 2, 2).finished();
  const Matrix2Xd b = (Matrix2Xd(2, 6) << 0, 2, 2, 1, 1, 0, 0, 0, 1, 1, 3, 3).finished();
  const auto worst = [&](Correspondence method) {
    const auto c = correspond({a, b}, method, 120);
    double sum = 0.0;
    for (int corner = 0; corner < 6; ++corner) {
      Eigen::Index k = 0;
      (c[0].colwise() - a.col(corner)).colwise().norm().minCoeff(&k);
      sum = std::max(sum, (c[1].col(k) - b.col(corner)).norm());
    }
    return sum;
  };
  EXPECT_LT(worst(Correspondence::matched), 0.2);
  EXPECT_GT(worst(Correspondence::arc_length), 0.5);
}

}  // namespace
}  // namespace semblance
