#include "semblance/cloth/contact.h"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <map>

#include "semblance/cloth/distance.h"
#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"
#include "sheets.h"

namespace semblance {
namespace {

using Eigen::Vector3d;
using testing::crumpled;
using testing::make_sheet;
using testing::noise;
using testing::rolled;

using Elements = std::array<int, 5>;  // kind, vertices of the first piece, and of the second

/// Every pair of parts of the sheet without a common vertex whose distance is below `reach_m`.
std::map<Elements, double> all_near(const ContactFinder& finder, const Triangles& triangles,
                                    const Points& x, double reach_m) {
  std::map<Elements, double> near;
  for (int v = 0; v < x.rows(); ++v) {
    for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
      const int a = triangles(t, 0), b = triangles(t, 1), c = triangles(t, 2);
      if (v == a || v == b || v == c) continue;
      const double d = closest_on_triangle(x.row(v), x.row(a), x.row(b), x.row(c)).offset_m.norm();
      if (d < reach_m) near[{0, v, a, b, c}] = d;
    }
  }
  const auto& edges = finder.edges();
  for (std::size_t e = 0; e < edges.size(); ++e) {
    for (std::size_t f = e + 1; f < edges.size(); ++f) {
      const auto [a, b] = edges[e];
      const auto [c, d] = edges[f];
      if (a == c || a == d || b == c || b == d) continue;
      const Vector3d u = x.row(b) - x.row(a), v = x.row(d) - x.row(c);
      if (u.cross(v).norm() < 1e-12 * u.norm() * v.norm()) continue;  // parallel: no weight
      const double distance_m =
          closest_on_segments(x.row(a), x.row(b), x.row(c), x.row(d)).offset_m.norm();
      if (distance_m < reach_m) near[{1, a, b, c, d}] = distance_m;
    }
  }
  return near;
}

std::map<Elements, double> as_map(const std::vector<Contact>& contacts) {
  std::map<Elements, double> result;
  for (const Contact& c : contacts)
    result[{static_cast<int>(c.kind), c.vertex[0], c.vertex[1], c.vertex[2], c.vertex[3]}] =
        c.gap_m;
  return result;
}

void expect_same(const std::map<Elements, double>& found, const std::map<Elements, double>& all) {
  ASSERT_EQ(found.size(), all.size());
  for (auto f = found.begin(), a = all.begin(); f != found.end(); ++f, ++a) {
    ASSERT_EQ(f->first, a->first);
    ASSERT_NEAR(f->second, a->second, 1e-14);
  }
}

TEST(Contacts, AreAllNearPairsOfACrumpledSheet) {
  const ContactSurface sheet = make_sheet(25, 21, 0.01);
  ContactOptions options;
  options.reach_m = 5e-3;
  ContactFinder finder(sheet, {}, options);
  for (int seed = 0; seed < 3; ++seed) {
    Points x = crumpled(sheet.rest_positions_m, 0.05, 0.05, seed);
    std::size_t count = 0;
    for (int step = 0; step < 12; ++step) {  // coherent: some steps do not gather anew
      finder.update(x);
      const auto all = all_near(finder, sheet.triangles, x, options.reach_m);
      expect_same(as_map(finder.contacts(x)), all);
      count += all.size();
      const double size_m = step % 4 == 3 ? 5e-3 : 1e-4;
      x += noise(x.rows(), size_m, 100 * seed + step);
      x.col(0).array() += 0.01;
    }
    EXPECT_GT(count, 1000u);
  }
  EXPECT_LT(finder.statistics().rebuilds, 30);
  EXPECT_GE(finder.statistics().rebuilds, 3);
}

TEST(Contacts, HaveTheGradientOfTheirGap) {
  const ContactSurface sheet = make_sheet(21, 17, 0.01);
  Rigid3 tilted{quaternion_from_rotation_vector({0.2, 0.4, -0.1}), {0.0, -0.03, 0.0}};
  const std::vector<Obstacle> obstacles = {
      make_box("box", {0.08, 0.05, 0.07}, tilted), make_prism("prism", 0.05, 0.03, 20, tilted),
      make_sphere("sphere", 0.03, {tilted.rotation, {0.05, 0.02, 0.02}}),
      make_mesh_obstacle("mesh", obstacle_mesh(make_box("", {0.09, 0.04, 0.05}, tilted), 0.0))};
  ContactOptions options;
  options.reach_m = 4e-3;
  options.thickness_m = 1e-3;
  ContactFinder finder(sheet, obstacles, options);
  const Points x = crumpled(sheet.rest_positions_m, 0.03, 0.05, 5);
  finder.update(x, 0.0);
  const std::vector<Contact> contacts = finder.contacts(x);
  const Points direction = noise(x.rows(), 1.0, 9);
  const double h = 1e-8;
  const auto gaps = [&](double step) {
    const Points moved = x + step * direction;
    finder.update(moved);
    std::map<std::uint64_t, double> result;
    for (const Contact& c : finder.contacts(moved)) result[c.key] = c.gap_m;
    return result;
  };
  const auto up = gaps(h), down = gaps(-h);
  std::map<ContactKind, int> compared;
  for (const Contact& c : contacts) {
    if (!up.contains(c.key) || !down.contains(c.key) || c.gap_m < -0.9e-3) continue;
    double slope = 0.0;
    for (int i = 0; i < 4; ++i)
      if (c.vertex[i] >= 0) slope += c.weight[i] * direction.row(c.vertex[i]).dot(c.normal);
    const double difference = (up.at(c.key) - down.at(c.key)) / (2.0 * h);
    EXPECT_NEAR(slope, difference, 2e-4 * (1.0 + std::abs(slope)) + 1e-6) << int(c.kind);
    ++compared[c.kind];
  }
  EXPECT_EQ(compared.size(), 7u);
  for (const auto& [kind, count] : compared) EXPECT_GE(count, 2) << int(kind);
}

TEST(Contacts, DescribeTheVectorBetweenClosestPoints) {
  const ContactSurface sheet = make_sheet(21, 17, 0.01);
  Rigid3 tilted{quaternion_from_rotation_vector({0.2, 0.4, -0.1}), {0.0, -0.03, 0.0}};
  ContactOptions options;
  options.reach_m = 4e-3;
  options.thickness_m = 1e-3;
  ContactFinder finder(sheet, {make_box("box", {0.08, 0.05, 0.07}, tilted, 0.01)}, options);
  const Points x = crumpled(sheet.rest_positions_m, 0.03, 0.05, 5);
  finder.update(x);
  for (const Contact& c : finder.contacts(x)) {
    Vector3d r = -c.obstacle_point_m;
    double sum = 0.0;
    for (int i = 0; i < 4; ++i) {
      if (c.vertex[i] >= 0) r += c.weight[i] * x.row(c.vertex[i]).transpose();
      sum += c.weight[i];
    }
    EXPECT_NEAR(sum, c.obstacle < 0 ? 0.0 : 1.0, 1e-14);
    const double thickness_m = c.obstacle < 0 ? 1e-3 : 0.5e-3;
    EXPECT_LT((r - (c.gap_m + thickness_m) * c.normal).norm(), 1e-13) << int(c.kind);
  }
}

TEST(Contacts, OfASheetWithItselfLeaveItsMomentum) {
  const ContactSurface sheet = make_sheet(41, 11, 0.005);
  ContactOptions options;
  options.reach_m = 2e-3;
  ContactFinder finder(sheet, {}, options);
  const Points x = rolled(sheet.rest_positions_m, 1.2e-3, 0.01);
  finder.update(x);
  Vector3d force = Vector3d::Zero(), torque = Vector3d::Zero();
  double size = 0.0;
  for (const Contact& c : finder.contacts(x)) {
    const Vector3d push = c.area_m2 / c.gap_m * c.normal;
    for (int i = 0; i < 4; ++i) {
      force += c.weight[i] * push;
      torque += c.weight[i] * Vector3d(x.row(c.vertex[i])).cross(push);
      size += std::abs(c.weight[i]) * push.norm();
    }
  }
  EXPECT_GT(size, 0.0);
  EXPECT_LT(force.norm(), 1e-13 * size);
  EXPECT_LT(torque.norm(), 1e-13 * size);
}

TEST(Contacts, DoNotDependOnTheNumberOfThreads) {
  const ContactSurface sheet = make_sheet(61, 51, 0.005);
  const std::vector<Obstacle> obstacles = {make_prism("prism", 0.06, 0.02, 64)};
  std::vector<std::vector<Contact>> results;
  std::vector<double> steps;
  std::vector<Eigen::VectorXd> vertex_steps(2);
  for (const int threads : {1, 2}) {
    set_thread_count(threads);
    ContactOptions options;
    options.reach_m = 2e-3;
    ContactFinder finder(sheet, obstacles, options);
    Points x = crumpled(sheet.rest_positions_m, 0.02, 0.05, 3);
    x.col(1).array() += 0.05;
    const Points dx = noise(x.rows(), 2e-3, 8);
    finder.update(x);
    results.push_back(finder.contacts(x));
    steps.push_back(finder.max_step(x, dx));
    finder.max_vertex_steps(x, dx, vertex_steps[threads - 1]);
  }
  set_thread_count(0);
  EXPECT_EQ(steps[0], steps[1]);
  EXPECT_EQ(vertex_steps[0], vertex_steps[1]);
  ASSERT_EQ(results[0].size(), results[1].size());
  EXPECT_GT(results[0].size(), 10u);
  for (std::size_t i = 0; i < results[0].size(); ++i) {
    EXPECT_EQ(results[0][i].key, results[1][i].key);
    EXPECT_EQ(results[0][i].gap_m, results[1][i].gap_m);
    EXPECT_EQ(results[0][i].normal, results[1][i].normal);
  }
}

TEST(Contacts, KeepTheirKeysAndOrder) {
  const ContactSurface sheet = make_sheet(41, 11, 0.005);
  ContactOptions options;
  options.reach_m = 2e-3;
  const std::vector<Obstacle> floor = {make_plane("floor", {0, -0.0135, 0}, {0, 1, 0}),
                                       make_box("box", {0.01, 0.01, 0.01})};
  ContactFinder first(sheet, floor, options), second(sheet, floor, options);
  const Points x = rolled(sheet.rest_positions_m, 1.2e-3, 0.01);
  const Points y = x + noise(x.rows(), 1e-5, 3);
  first.update(x);
  second.update(y);
  std::map<std::uint64_t, std::array<int, 4>> vertices;
  std::uint64_t last = 0;
  for (const Contact& c : first.contacts(x)) {
    EXPECT_TRUE(vertices.emplace(c.key, c.vertex).second) << "twice the same key";
    EXPECT_GE(c.key, last);
    last = c.key;
  }
  int same = 0;
  for (const Contact& c : second.contacts(y)) {
    const auto found = vertices.find(c.key);
    if (found == vertices.end()) continue;
    EXPECT_EQ(found->second, c.vertex);
    ++same;
  }
  EXPECT_GT(same, static_cast<int>(0.9 * vertices.size()));
}

/// Two square sheets of about 0.2 m, one over the other and turned.
ContactSurface two_layers(double spacing_m, double turn_rad, double gap_m) {
  const int side = static_cast<int>(std::lround(0.2 / spacing_m)) + 1;
  const ContactSurface one = make_sheet(side, side, spacing_m);
  const Eigen::Index n = one.rest_positions_m.rows(), m = one.triangles.rows();
  ContactSurface both;
  both.rest_positions_m.resize(2 * n, 3);
  both.rest_positions_m << one.rest_positions_m,
      one.rest_positions_m *
          Eigen::AngleAxisd(turn_rad, Vector3d::UnitY()).toRotationMatrix().transpose();
  both.rest_positions_m.bottomRows(n).col(1).array() += gap_m;
  both.triangles.resize(2 * m, 3);
  both.triangles << one.triangles, (one.triangles.array() + static_cast<int>(n)).matrix();
  return both;
}

TEST(Contacts, OfTwoLayersHaveTheirCommonArea) {
  // Reach is small beside the spacing, so that pairs next to the closest ones do not count.
  for (const double spacing_m : {0.02, 0.01, 0.005}) {
    double sum = 0.0, common = 0.0;
    for (const double turn : {0.2, 0.4, 0.6, 0.9, 1.2}) {
      ContactOptions options;
      options.reach_m = 1.001e-4;
      const double gap_m = 1e-4;
      // Rest neighbours are judged by the rest shape: there the layers are far apart.
      ContactSurface layers = two_layers(spacing_m, turn, 0.1);
      ContactFinder finder(layers, {}, options);
      const Points x = two_layers(spacing_m, turn, gap_m).rest_positions_m;
      finder.update(x);
      for (const Contact& c : finder.contacts(x)) sum += c.area_m2;
      // Two squares of side a about one centre, turned: an octagon.
      common += 0.04 * 2.0 / (1.0 + std::sin(turn) + std::cos(turn));
    }
    // Borders: edges along them have half the area.
    EXPECT_NEAR(sum, common, (0.02 + 5.0 * spacing_m) * common) << spacing_m;
  }
}

TEST(Contacts, OnATableAreOnePerVertex) {
  const ContactSurface sheet = make_sheet(31, 31, 0.01);
  ContactFinder finder(
      sheet,
      {make_box("table", {0.6, 0.4, 0.6}, {Eigen::Quaterniond::Identity(), {0.0, -0.2, 0.0}})}, {});
  Points x = sheet.rest_positions_m;
  x.col(1).array() += 0.5e-3;
  finder.update(x);
  const std::vector<Contact>& contacts = finder.contacts(x);
  ASSERT_EQ(contacts.size(), 31u * 31u);
  double area_m2 = 0.0;
  for (const Contact& c : contacts) {
    EXPECT_EQ(c.kind, ContactKind::vertex_solid);
    EXPECT_NEAR(c.gap_m, 0.5e-3, 1e-15);
    EXPECT_LT((c.normal - Vector3d::UnitY()).norm(), 1e-15);
    area_m2 += c.area_m2;
  }
  EXPECT_NEAR(area_m2, 0.09, 1e-14);
}

TEST(Contacts, AcrossASharpEdgeSumToItsLength) {
  for (const double spacing_m : {0.02, 0.01, 0.005}) {
    double sum = 0.0, length_m = 0.0;
    for (const double turn : {0.2, 0.4, 0.6, 0.9, 1.2}) {
      const int side = static_cast<int>(std::lround(0.4 / spacing_m)) + 1;
      const ContactSurface sheet = make_sheet(side, side, spacing_m);
      const Rigid3 turned{quaternion_from_rotation_vector({0.0, turn, 0.0}) *
                              quaternion_from_rotation_vector({0.25 * M_PI, 0.0, 0.0}),
                          {0.0, 0.0, 0.0}};
      const double half_m = 0.05 * std::sqrt(2.0);  // the box stands on an edge
      ContactOptions options;
      options.reach_m = 1.001e-4;
      ContactFinder finder(sheet, {make_box("box", {0.2, 0.1, 0.1}, turned)}, options);
      Points x = sheet.rest_positions_m;
      x.col(1).array() += half_m + 1e-4;
      finder.update(x);
      for (const Contact& c : finder.contacts(x))
        if (c.kind == ContactKind::edge_solid_edge) sum += c.area_m2 / (5.0 * options.reach_m);
      length_m += 0.2;
    }
    EXPECT_NEAR(sum, length_m, (0.03 + 8.0 * spacing_m) * length_m) << spacing_m;
  }
}

TEST(Contacts, DoNotPushNeighboursAtRest) {
  const ContactSurface sheet = make_sheet(21, 17, 1e-3);
  ContactOptions options;
  options.reach_m = 2e-3;
  options.thickness_m = 0.5e-3;
  ContactFinder finder(sheet, {}, options);
  finder.update(sheet.rest_positions_m);
  EXPECT_TRUE(finder.contacts(sheet.rest_positions_m).empty());
  // Folded over they still meet.
  Points x = sheet.rest_positions_m;
  for (Eigen::Index v = 0; v < x.rows(); ++v)
    if (x(v, 0) > 0.5e-3) x.row(v) << 1e-3 - x(v, 0), 0.8e-3, x(v, 2) + 1e-5;
  finder.update(x);
  EXPECT_GT(finder.contacts(x).size(), 100u);
  // And nothing passes: press the halves together.
  Points press = Points::Zero(x.rows(), 3);
  for (Eigen::Index v = 0; v < x.rows(); ++v)
    if (x(v, 1) > 0.0) press(v, 1) = -2e-3;
  const double fraction = finder.max_step(x, press);
  EXPECT_LT(fraction, 0.4);
  EXPECT_GT(fraction, 0.0);
}

TEST(Contacts, KnowHowObstaclesMove) {
  const ContactSurface sheet = make_sheet(5, 5, 0.01);
  Obstacle box = make_box("box", {0.1, 0.1, 0.1});
  const Vector3d velocity(0.3, 0.0, -0.2), spin(0.1, 2.0, 0.3);
  box.world_from_body = [=](double t) {
    return Rigid3{quaternion_from_rotation_vector(spin * t),
                  Vector3d(0, -0.0505, 0) + velocity * t};
  };
  Obstacle mesh = make_mesh_obstacle("mesh", obstacle_mesh(make_box("", {0.1, 0.1, 0.1}), 0.0));
  const Points start = mesh.surface->positions_m.rowwise() + Eigen::RowVector3d(0, 0.0505, 0);
  const Points stop = start.rowwise() + velocity.transpose();
  mesh.vertices = vertex_frames({-1.0, 1.0}, {start.rowwise() - velocity.transpose(), stop});
  ContactFinder finder(sheet, {box, mesh}, {});
  finder.update(sheet.rest_positions_m, 0.0);
  int of_box = 0, of_mesh = 0;
  for (const Contact& c : finder.contacts(sheet.rest_positions_m)) {
    Vector3d expected = velocity;
    if (c.obstacle == 0) expected += spin.cross(c.obstacle_point_m - Vector3d(0, -0.0505, 0));
    EXPECT_LT((c.obstacle_velocity_m_s - expected).norm(), 1e-6);
    (c.obstacle == 0 ? of_box : of_mesh)++;
  }
  EXPECT_GT(of_box, 0);
  EXPECT_GT(of_mesh, 0);
}

TEST(Contacts, RefuseWhatCannotBe) {
  const ContactSurface sheet = make_sheet(5, 5, 0.01);
  ContactOptions options;
  options.reach_m = 0.0;
  EXPECT_THROW(ContactFinder(sheet, {}, options), InvalidInput);
  options.reach_m = 1e-3;
  options.thickness_m = -1.0;
  EXPECT_THROW(ContactFinder(sheet, {}, options), InvalidInput);
  EXPECT_THROW(ContactFinder(sheet, {Obstacle{}}, {}), InvalidInput);
  EXPECT_THROW(ContactFinder({}, {}, {}), InvalidInput);
  ContactFinder finder(sheet, {}, {});
  EXPECT_THROW(finder.update(Points::Zero(3, 3)), InvalidInput);
  Points x = sheet.rest_positions_m;
  x(3, 1) = NAN;
  EXPECT_THROW(finder.update(x), SolverError);
}

}  // namespace
}  // namespace semblance
