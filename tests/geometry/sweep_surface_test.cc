#include "semblance/geometry/sweep_surface.h"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "semblance/core/errors.h"
#include "semblance/core/random.h"

namespace semblance {
namespace {

using Eigen::Matrix2Xd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

const double pi = std::numbers::pi;

std::vector<SweepContour> circles(const std::vector<double>& radii) {
  std::vector<SweepContour> contours;
  for (std::size_t i = 0; i < radii.size(); ++i) {
    SweepContour c{.contour = PlanarContour(named_outline("circle", radii[i], 128))};
    c.position = double(i) / double(radii.size() - 1);
    contours.push_back(c);
  }
  return contours;
}

// Area of the side and volume within (ends closed by planes through the axis' ends), integrated:
// the trapezoid rule in u, which is exact for smooth periodic functions, and Gauss' five points in
// v.
struct Extent {
  double area, volume;
};
Extent integrate(const SweepSurface& surface) {
  static constexpr double x[] = {0.0, 0.5384693101056831, 0.9061798459386640};
  static constexpr double w[] = {128.0 / 225.0, 0.4786286704993665, 0.2369268850561891};
  const int around = 256, panels = 16;
  Extent sum{0.0, 0.0};
  for (int segment = 0; segment < surface.segment_count(); ++segment) {
    for (int panel = 0; panel < panels; ++panel) {
      for (int g = -2; g <= 2; ++g) {
        const double node = g < 0 ? -x[-g] : x[g];
        const double v = (panel + 0.5 + 0.5 * node) / panels;
        for (int k = 0; k < around; ++k) {
          const auto p = surface.at(2 * pi * k / around, segment, v);
          const Vector3d normal = p.du.cross(p.dv);
          const double part = w[std::abs(g)] * 0.5 / panels * 2 * pi / around;
          sum.area += part * normal.norm();
          sum.volume += part * normal.dot(p.position_m) / 3.0;
        }
      }
    }
  }
  return sum;
}

MovingFrame straight(double height) {
  return MovingFrame(make_line({0, 0, 0}, {0, 0, height}), FrameKind::rotation_minimising);
}

TEST(SweepSurface, CircleAlongALineIsACylinder) {
  const double r = 0.3, h = 1.2;
  const Extent e = integrate(SweepSurface(straight(h), circles({r, r}), {{}}));
  EXPECT_NEAR(e.area, 2 * pi * r * h, 1e-6);
  // The divergence integral lacks the lid at z = h: its part is r^2 pi h / 3.
  EXPECT_NEAR(e.volume + pi * r * r * h / 3, pi * r * r * h, 1e-6);
}

TEST(SweepSurface, LinearBlendOfTwoCirclesIsACone) {
  const double r1 = 0.5, r2 = 0.2, h = 0.4;
  SweepSegment linear;
  linear.blend = BlendForm::rational;
  const Extent e = integrate(SweepSurface(straight(h), circles({r1, r2}), {linear}));
  EXPECT_NEAR(e.area, pi * (r1 + r2) * std::hypot(h, r1 - r2), 1e-6);
  EXPECT_NEAR(e.volume + pi * r2 * r2 * h / 3, pi * h * (r1 * r1 + r1 * r2 + r2 * r2) / 3, 1e-6);
}

TEST(SweepSurface, CircleTurnedAboutAnAxisIsATorus) {
  const double big = 0.7, small = 0.2;
  for (const FrameKind kind :
       {FrameKind::frenet, FrameKind::adapted, FrameKind::rotation_minimising}) {
    const MovingFrame frame(make_helix(Vector3d::Zero(), Vector3d::UnitY(), {big, 0, 0}, 2 * pi),
                            kind);
    const Extent e = integrate(SweepSurface(frame, circles({small, small}), {{}}));
    EXPECT_NEAR(e.area, 4 * pi * pi * big * small, 1e-5);
    EXPECT_NEAR(e.volume, 2 * pi * pi * big * small * small, 1e-5);
  }
}

TEST(SweepSurface, MeshIsClosedAndHasItsVolume) {
  const Mesh mesh =
      SweepSurface(straight(1.0), circles({0.3, 0.5, 0.2}), {{}, {}}).mesh(96, 24, true);
  validate(mesh, "sweep");
  double volume = 0.0;
  Vector3d closure = Vector3d::Zero();
  for (Eigen::Index t = 0; t < mesh.triangle_count(); ++t) {
    const Vector3d a = mesh.positions_m.row(mesh.triangles(t, 0)),
                   b = mesh.positions_m.row(mesh.triangles(t, 1)),
                   c = mesh.positions_m.row(mesh.triangles(t, 2));
    volume += a.dot(b.cross(c)) / 6.0;
    closure += (b - a).cross(c - a);
  }
  EXPECT_LT(closure.norm(), 1e-12);  // the area vectors of a closed surface cancel
  const double lid = pi * 0.2 * 0.2 / 3.0;
  const double exact =
      integrate(SweepSurface(straight(1.0), circles({0.3, 0.5, 0.2}), {{}, {}})).volume + lid;
  EXPECT_NEAR(volume, exact, 2e-3 * exact);  // chords of 96 sides: 0.07 %
  EXPECT_LT(volume, exact);
}

// A sweep with every option and random controls.
SweepSurface random_surface(Random& random, bool with_crease) {
  std::vector<Vector3d> path;
  for (int i = 0; i < 5; ++i) {
    path.emplace_back(0.3 * i, random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1));
  }
  std::vector<SweepContour> contours;
  for (int i = 0; i < 4; ++i) {
    Matrix2Xd points = named_outline("circle", random.uniform(0.1, 0.3), 12);
    for (Eigen::Index k = 0; k < points.cols(); ++k) points.col(k) *= random.uniform(0.8, 1.2);
    SweepContour c{.contour = PlanarContour(points)};
    c.position = i / 3.0 + (i % 3 ? random.uniform(-0.1, 0.1) : 0.0);
    c.slope = Vector2d(random.uniform(-3, 3), random.uniform(-3, 3));
    if (i == 1) c.bias = random.uniform(0.6, 1.6);
    if (with_crease && i == 2) c.slope_after = Vector2d(random.uniform(-3, 3), 5.0);
    contours.push_back(c);
  }
  std::vector<SweepSegment> segments(3);
  for (SweepSegment& s : segments) s.n = random.uniform(-0.8, 6.0);
  segments[0].features_x = {{0.3, random.uniform(-0.3, 0.3)}, {0.6, random.uniform(-0.3, 0.3)}};
  segments[1].features_y = {{0.5, random.uniform(-0.3, 0.3)}};
  return SweepSurface(MovingFrame(make_spline(path), FrameKind::rotation_minimising), contours,
                      segments);
}

TEST(SweepSurface, EndsAreTheContoursForRandomControls) {
  Random random(7);
  for (int trial = 0; trial < 20; ++trial) {
    const SweepSurface surface = random_surface(random, true);
    const MovingFrame frame(make_line({0, 0, 0}, {1, 0, 0}), FrameKind::rotation_minimising);
    for (int i = 0; i < 4; ++i) {
      for (double u = 0.1; u < 6.0; u += 0.7) {
        const auto here = surface.at(u, std::min(i, 2), i < 3 ? 0.0 : 1.0);
        if (i > 0) {
          const auto before = surface.at(u, i - 1, 1.0);
          EXPECT_LT((before.position_m - here.position_m).norm(), 1e-13);
        }
        // Distance from the trajectory is the contour's radius.
        const Vector2d c = surface.contours()[i].contour.at(u).point;
        const auto opposite = surface.at(u + pi, std::min(i, 2), i < 3 ? 0.0 : 1.0);
        const Vector2d d = surface.contours()[i].contour.at(u + pi).point;
        EXPECT_NEAR((here.position_m - opposite.position_m).norm(), (c - d).norm(), 1e-12);
      }
    }
  }
}

TEST(SweepSurface, JointsAreSmoothWithTheirBiasForRandomControls) {
  Random random(11);
  for (int trial = 0; trial < 50; ++trial) {
    const SweepSurface surface = random_surface(random, false);
    for (int joint = 1; joint < 3; ++joint) {
      const SweepContour& c = surface.contours()[joint];
      const double k = c.bias.value_or((c.position - surface.contours()[joint - 1].position) /
                                       (surface.contours()[joint + 1].position - c.position));
      for (double u = 0.1; u < 6.0; u += 0.7) {
        const auto a = surface.at(u, joint - 1, 1.0), b = surface.at(u, joint, 0.0);
        EXPECT_LT((a.dv - k * b.dv).norm(), 1e-10 * a.dv.norm());  // eq. 2
        const Vector3d na = a.du.cross(a.dv).normalized(), nb = b.du.cross(b.dv).normalized();
        EXPECT_LT(na.cross(nb).norm(), 1e-10);
      }
    }
  }
}

TEST(SweepSurface, CreasesAreKept) {
  Random random(13);
  const SweepSurface surface = random_surface(random, true);
  const auto angle = [&](int joint) {
    const auto a = surface.at(0.3, joint - 1, 1.0), b = surface.at(0.3, joint, 0.0);
    return a.du.cross(a.dv).normalized().cross(b.du.cross(b.dv).normalized()).norm();
  };
  EXPECT_LT(angle(1), 1e-10);
  EXPECT_GT(angle(2), 0.01);
}

TEST(SweepSurface, RationalBlendLeavesCreases) {
  std::vector<SweepSegment> segments(2);
  segments[0].blend = BlendForm::rational;
  const SweepSurface surface(straight(1.0), circles({0.2, 0.5, 0.3}), segments);
  const auto a = surface.at(0.0, 0, 1.0), b = surface.at(0.0, 1, 0.0);
  EXPECT_GT(a.dv.normalized().cross(b.dv.normalized()).norm(), 0.1);
}

TEST(SweepSurface, TangentsAreDifferences) {
  Random random(17);
  const SweepSurface surface = random_surface(random, true);
  const double h = 1e-6;
  for (int segment = 0; segment < 3; ++segment) {
    for (const double v : {0.2, 0.45, 0.9}) {
      for (const double u : {0.4, 3.1}) {
        const auto p = surface.at(u, segment, v);
        const Vector3d du =
            (surface.at(u + h, segment, v).position_m - surface.at(u - h, segment, v).position_m) /
            (2 * h);
        const Vector3d dv =
            (surface.at(u, segment, v + h).position_m - surface.at(u, segment, v - h).position_m) /
            (2 * h);
        EXPECT_LT((p.du - du).norm(), 1e-8);
        EXPECT_LT((p.dv - dv).norm(), 1e-7);
      }
    }
  }
}

TEST(SweepSurface, DerivativesByEveryControlAreDifferences) {
  Random random(19);
  for (int trial = 0; trial < 3; ++trial) {
    const SweepSurface surface = random_surface(random, trial != 0);
    const VectorXd x = surface.controls();
    ASSERT_EQ(surface.control_names().size(), static_cast<std::size_t>(x.size()));
    for (int segment = 0; segment < 3; ++segment) {
      const double u = random.uniform(0, 2 * pi), v = random.uniform(0.1, 0.9), h = 1e-6;
      const auto d = surface.derivatives(u, segment, v);
      for (Eigen::Index k = 0; k < x.size(); ++k) {
        // The end contours' positions are bounds of the trajectory: step inwards only.
        const double up =
            x[k] + h > 1.0 && surface.control_names()[k] == "contour3.position" ? 0 : h;
        const double down = surface.control_names()[k] == "contour0.position" ? 0 : h;
        SweepSurface a = surface, b = surface;
        VectorXd y = x;
        y[k] = x[k] - down;
        a.set_controls(y);
        y[k] = x[k] + up;
        b.set_controls(y);
        const Vector3d difference =
            (b.at(u, segment, v).position_m - a.at(u, segment, v).position_m) / (up + down);
        EXPECT_LT((d.col(k) - difference).norm(), 1e-5) << surface.control_names()[k];
      }
    }
  }
}

TEST(SweepSurface, FeaturePointsLeadThePath) {
  SweepSegment s;
  s.features_x = {{0.25, 0.4}, {0.75, -0.2}};
  const SweepSurface surface(straight(1.0), circles({0.5, 0.5}), {s});
  EXPECT_NEAR(surface.at(pi / 2, 0, 0.25).position_m.head<2>().norm(), 0.5, 1e-6);  // y: untouched
  const MovingFrame frame = straight(1.0);
  EXPECT_NEAR(surface.at(0.0, 0, 0.25).position_m.dot(frame.at(0.25).normal), 0.5 * 1.4, 1e-6);
  EXPECT_NEAR(surface.at(0.0, 0, 0.75).position_m.dot(frame.at(0.75).normal), 0.5 * 0.8, 1e-6);
}

TEST(SweepSurface, RejectsWithTheRemedy) {
  const auto message = [](std::vector<SweepContour> c, std::vector<SweepSegment> s,
                          const char* expected) {
    EXPECT_THAT([&] { SweepSurface(straight(1.0), c, s); },
                ThrowsMessage<InvalidInput>(HasSubstr(expected)));
  };
  message(circles({0.1}), {}, "at least two contours");
  message(circles({0.1, 0.1}), {}, "2 contours need 1 segments");
  auto same = circles({0.1, 0.1, 0.2});
  same[1].position = 0.0;
  message(same, {{}, {}}, "contour 2 lies at");
  SweepSegment low;
  low.n = -1.0;
  message(circles({0.1, 0.1}), {low}, "segment 1: blending parameter n");
  auto biased = circles({0.1, 0.1, 0.2});
  biased[1].bias = 400.0;
  message(biased, {{}, {}}, "bring k nearer to 1");
  auto end = circles({0.1, 0.1});
  end[1].bias = 1.0;
  message(end, {{}}, "inner contour");
  auto other = circles({0.1, 0.1});
  other[1].contour = PlanarContour(named_outline("circle", 0.1, 50));
  message(other, {{}}, "as many points");
}

}  // namespace
}  // namespace semblance
