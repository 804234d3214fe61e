// Steps: nothing passes through, and little is given away.
#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <iostream>

#include "semblance/cloth/contact.h"
#include "semblance/cloth/distance.h"
#include "sheets.h"

namespace semblance {
namespace {

using Eigen::Vector3d;
using testing::crumpled;
using testing::make_sheet;
using testing::noise;
using testing::rolled;

/// Two triangles that have nothing to do with each other at rest.
ContactSurface two_triangles() {
  ContactSurface surface;
  surface.rest_positions_m.resize(6, 3);
  surface.rest_positions_m << 0, 0, 0, 1, 0, 0, 0, 1, 0, 10, 0, 0, 11, 0, 0, 10, 1, 0;
  surface.triangles.resize(2, 3);
  surface.triangles << 0, 1, 2, 3, 4, 5;
  return surface;
}

double triangle_gap(const Points& x) {
  double gap = 1e9;
  for (int v = 0; v < 3; ++v) {
    gap =
        std::min(gap, closest_on_triangle(x.row(v), x.row(3), x.row(4), x.row(5)).offset_m.norm());
    gap = std::min(gap,
                   closest_on_triangle(x.row(v + 3), x.row(0), x.row(1), x.row(2)).offset_m.norm());
    for (int w = 0; w < 3; ++w)
      gap = std::min(gap, closest_on_segments(x.row(v), x.row((v + 1) % 3), x.row(3 + w),
                                              x.row(3 + (w + 1) % 3))
                              .offset_m.norm());
  }
  return gap;
}

/// First time at which the gap falls to `gap_m`, by dense samples; 1 if it never does.
template <typename Gap>
double first_time(const Gap& gap, double gap_m) {
  constexpr int samples = 4000;
  for (int i = 1; i <= samples; ++i) {
    if (gap(double(i) / samples) > gap_m) continue;
    double before = double(i - 1) / samples, after = double(i) / samples;
    for (int k = 0; k < 50; ++k) {
      const double middle = 0.5 * (before + after);
      (gap(middle) > gap_m ? before : after) = middle;
    }
    return before;
  }
  return 1.0;
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

TEST(MaxStep, OfTwoTrianglesNeverPassesAndIsNearlyTheLongest) {
  const ContactSurface surface = two_triangles();
  ContactOptions options;
  options.reach_m = 0.01;
  ContactFinder finder(surface, {}, options);
  Random random(1);
  std::vector<double> ratios;
  int passed_whole = 0;
  for (int i = 0; i < 400; ++i) {
    Points x = noise(6, 0.5, 2 * i);
    x.bottomRows(3).col(0).array() += random.uniform(0.3, 3.0);
    if (triangle_gap(x) < 0.03 || !finder.penetrations(x).empty()) continue;
    Points dx = noise(6, random.uniform(0.1, 1.0), 2 * i + 1);
    dx.topRows(3).col(0).array() += random.uniform(0.0, 4.0);
    finder.update(x);
    const double fraction = finder.max_step(x, dx);
    ASSERT_GT(fraction, 0.0);
    ASSERT_LE(fraction, 1.0);
    const auto gap = [&](double t) { return triangle_gap(x + t * dx); };
    const double start = gap(0.0);
    for (int k = 0; k <= 200; ++k)
      ASSERT_GT(gap(fraction * k / 200), std::min(0.0999 * start, 0.0999 * options.reach_m));
    ASSERT_TRUE(finder.penetrations(x + fraction * dx).empty());
    // The longest step that leaves what must be left (each pair has its own gap: a lower bound).
    const double longest = first_time(gap, 0.1 * start);
    if (longest == 1.0) {
      passed_whole += fraction == 1.0;
    } else {
      ratios.push_back(fraction / longest);
    }
  }
  std::cout << "fraction of the longest step, median of " << ratios.size() << ": " << median(ratios)
            << ", worst " << *std::min_element(ratios.begin(), ratios.end())
            << "; free and found free: " << passed_whole << "\n";
  EXPECT_GT(ratios.size(), 50u);
  EXPECT_GT(median(ratios), 0.9);
  EXPECT_GT(passed_whole, 50);
}

TEST(MaxStep, DoesNotMindSliding) {
  const ContactSurface sheet = make_sheet(21, 21, 0.01);
  ContactFinder finder(sheet, {make_plane("floor", {0, 0, 0}, {0, 1, 0})}, {});
  Points x = sheet.rest_positions_m;
  x.col(1).array() += 1e-4;
  Points dx = Points::Zero(x.rows(), 3);
  dx.col(0).array() += 0.5;
  finder.update(x);
  EXPECT_EQ(finder.max_step(x, dx), 1.0);
  dx.col(1).array() -= 1e-3;
  EXPECT_NEAR(finder.max_step(x, dx), 0.09, 1e-12);  // a tenth of the gap is left
}

/// Sheet pushed at random, again and again; nothing may ever cross.
void push_about(ContactFinder& finder, Points x, double size_m, int steps, int seed,
                bool each_vertex) {
  finder.update(x);
  ASSERT_TRUE(finder.penetrations(x).empty());
  Eigen::VectorXd fractions;
  for (int step = 0; step < steps; ++step) {
    Points dx = noise(x.rows(), 0.3 * size_m, 1000 * seed + step);
    dx += 2.0 * crumpled(Points::Zero(x.rows(), 3) + x, size_m, 0.03, step) - 2.0 * x;
    if (each_vertex) {
      finder.max_vertex_steps(x, dx, fractions);
      ASSERT_GT(fractions.minCoeff(), 0.0);
      Random random(step);
      for (Eigen::Index v = 0; v < x.rows(); ++v)
        x.row(v) += (v % 3 ? 1.0 : random.uniform()) * fractions[v] * dx.row(v);
    } else {
      const double fraction = finder.max_step(x, dx);
      ASSERT_GT(fraction, 0.0);
      x += fraction * dx;
    }
    finder.update(x);
    ASSERT_TRUE(finder.penetrations(x).empty()) << "step " << step;
    for (const Contact& c : finder.contacts(x)) ASSERT_GT(c.gap_m, 0.0);
  }
}

TEST(MaxStep, KeepsARollFromCrossingItself) {
  const ContactSurface sheet = make_sheet(61, 9, 0.005);
  ContactOptions options;
  options.reach_m = 1.5e-3;
  for (const double size_m : {2e-4, 2e-3, 0.05}) {  // the last two need more than gathered pairs
    ContactFinder finder(sheet, {}, options);
    push_about(finder, rolled(sheet.rest_positions_m, 1.5e-3, 0.01), size_m, 25, 1, false);
    if (size_m > 1e-2) {
      EXPECT_GT(finder.statistics().swept_searches, 0);
    }
  }
}

TEST(MaxVertexSteps, KeepARollFromCrossingItselfForAnyChoice) {
  const ContactSurface sheet = make_sheet(61, 9, 0.005);
  ContactOptions options;
  options.reach_m = 1.5e-3;
  options.thickness_m = 2e-4;
  for (const double size_m : {2e-4, 2e-3, 0.05}) {
    ContactFinder finder(sheet, {}, options);
    push_about(finder, rolled(sheet.rest_positions_m, 1.5e-3, 0.01), size_m, 25, 2, true);
  }
}

TEST(MaxVertexSteps, LetOthersGoOn) {
  const ContactSurface sheet = make_sheet(21, 21, 0.01);
  ContactFinder finder(sheet, {make_plane("floor", {0, 0, 0}, {0, 1, 0})}, {});
  Points x = sheet.rest_positions_m;
  x.col(1).array() += 0.01;
  x(0, 1) = 1e-5;
  Points dx = Points::Zero(x.rows(), 3);
  dx.col(1).array() -= 2e-3;
  finder.update(x);
  EXPECT_LT(finder.max_step(x, dx), 0.01);
  Eigen::VectorXd fractions;
  finder.max_vertex_steps(x, dx, fractions);
  EXPECT_LT(fractions[0], 0.01);
  EXPECT_EQ((fractions.array() == 1.0).count(), x.rows() - 1);
}

std::vector<Obstacle> solids_below() {
  const Rigid3 on_edge{quaternion_from_rotation_vector({0.25 * M_PI, 0.3, 0.0}),
                       {0.03, -0.06, 0.02}};
  const Rigid3 below{Eigen::Quaterniond::Identity(), {-0.05, -0.03, -0.04}};
  return {make_box("bar", {0.2, 0.05, 0.05}, on_edge), make_prism("disc", 0.05, 0.01, 32, below),
          make_sphere("ball", 0.02, {Eigen::Quaterniond::Identity(), {0.05, -0.03, -0.06}}),
          make_box("rounded", {0.04, 0.04, 0.04}, {on_edge.rotation, {-0.05, -0.05, 0.06}}, 0.005),
          make_mesh_obstacle("spike", obstacle_mesh(make_box("", {0.02, 0.05, 0.02},
                                                             {on_edge.rotation, {0.0, -0.05, 0.0}}),
                                                    0.0))};
}

TEST(MaxStep, LetsACoarseSheetThroughNoBody) {
  // The spacing is as large as the bodies: vertices pass beside edges and corners.
  const ContactSurface sheet = make_sheet(9, 9, 0.03);
  for (const bool each_vertex : {false, true}) {
    ContactOptions options;
    options.thickness_m = 4e-4;
    ContactFinder finder(sheet, solids_below(), options);
    Points x = sheet.rest_positions_m;
    Eigen::VectorXd fractions;
    finder.update(x);
    int contacts = 0;
    for (int step = 0; step < 60; ++step) {
      Points dx = noise(x.rows(), 2e-3, step);
      dx.col(1).array() -= step % 5 == 4 ? 0.2 : 0.01;
      if (each_vertex) {
        finder.max_vertex_steps(x, dx, fractions);
        x += fractions.asDiagonal() * dx;
      } else {
        x += finder.max_step(x, dx) * dx;
      }
      finder.update(x);
      ASSERT_TRUE(finder.penetrations(x, true).empty()) << step;
      contacts += finder.contacts(x).size();
    }
    EXPECT_GT(contacts, 0);
  }
}

TEST(MaxStepUntil, StopsBodiesThatComeAndTurn) {
  const ContactSurface sheet = make_sheet(17, 17, 0.01);
  for (const bool as_mesh : {false, true}) {
    Obstacle bar = make_box("bar", {0.3, 0.02, 0.02});
    const RigidMotion motion = [](double t) {
      return Rigid3{quaternion_from_rotation_vector({0.4 * t, 9.0 * t, 0.7 * t}),
                    {0.02 * t, -0.04 + 0.5 * t, 0.0}};
    };
    if (as_mesh) {
      bar = make_mesh_obstacle("bar", obstacle_mesh(bar, 0.0));
      const Points body = bar.surface->positions_m;
      bar.vertices = [=](double t, Points& x) {
        for (Eigen::Index v = 0; v < body.rows(); ++v)
          x.row(v) = (motion(t) * Vector3d(body.row(v))).transpose();
      };
    } else {
      bar.world_from_body = motion;
    }
    ContactFinder finder(sheet, {bar}, {});
    Points x = sheet.rest_positions_m;
    finder.update(x, 0.0);
    bool stopped = false;
    double time_s = 0.0;
    for (int step = 0; step < 40; ++step) {
      Points dx = noise(x.rows(), 2e-4, step);
      for (const Contact& c : finder.contacts(x))  // faster than the bar comes
        for (int i = 0; i < 4 && c.vertex[i] >= 0; ++i)
          dx.row(c.vertex[i]) += 2e-2 * c.weight[i] * c.normal.transpose();
      const double next_s = time_s + 0.01;
      const double fraction = finder.max_step_until(x, dx, next_s);
      ASSERT_GT(fraction, 0.0);
      stopped |= fraction < 1.0;
      x += fraction * dx;
      finder.move_obstacles(next_s, fraction);
      time_s += fraction * 0.01;
      finder.update(x);
      ASSERT_TRUE(finder.penetrations(x).empty()) << step;
      for (const Contact& c : finder.contacts(x)) ASSERT_GT(c.gap_m, 0.0) << step;
    }
    EXPECT_TRUE(stopped);
  }
}

TEST(MaxStepUntil, LetsClothRideAlong) {
  const ContactSurface sheet = make_sheet(11, 11, 0.01);
  Obstacle lift = make_box("lift", {0.2, 0.1, 0.2});
  lift.world_from_body = [](double t) {
    return Rigid3{Eigen::Quaterniond::Identity(), {0.0, -0.0501 + t, 0.0}};
  };
  ContactFinder finder(sheet, {lift}, {});
  Points x = sheet.rest_positions_m, dx = Points::Zero(x.rows(), 3);
  finder.update(x, 0.0);
  EXPECT_LT(finder.max_step_until(x, dx, 0.02), 0.01);
  dx.col(1).array() += 0.02;
  EXPECT_EQ(finder.max_step_until(x, dx, 0.02), 1.0);
}

}  // namespace
}  // namespace semblance
