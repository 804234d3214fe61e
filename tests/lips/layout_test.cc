#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "assignment.h"
#include "painted_mouth.h"
#include "semblance/lips/mouth_layout.h"

namespace semblance {
namespace {

using Eigen::Vector2d;
using testing::mouth_shape;
using testing::place_mouth;

std::vector<int> shuffled(int count, Random& random) {
  std::vector<int> order(static_cast<std::size_t>(count));
  std::iota(order.begin(), order.end(), 0);
  for (int i = count - 1; i > 0; --i) std::swap(order[i], order[random.integer(i + 1)]);
  return order;
}

TEST(MouthLayout, NamesMarkersOfEveryMouth) {
  Random random(5);
  for (int trial = 0; trial < 300; ++trial) {
    const int count = trial % 2 == 0 ? 16 : 8;
    auto shape = mouth_shape(random.uniform(0.0, 1.0));
    shape.resize(static_cast<std::size_t>(count));
    for (Vector2d& p : shape) {
      p.x() *= random.uniform(0.97, 1.0);
      p += 0.015 * Vector2d(random.normal(), random.normal());
    }
    const auto places =
        place_mouth(shape, {300, 200}, random.uniform(30, 150), random.uniform(-0.6, 0.6));
    const auto order = shuffled(count, random);
    std::vector<Vector2d> points;
    for (const int i : order) points.push_back(places[static_cast<std::size_t>(i)]);
    const auto found = order_markers(points, 1.0);
    ASSERT_TRUE(found) << "trial " << trial;
    for (int i = 0; i < count; ++i) {
      EXPECT_EQ(order[static_cast<std::size_t>((*found)[static_cast<std::size_t>(i)])], i);
    }
  }
}

TEST(MouthLayout, OtherArrangementsHaveNoNames) {
  auto points = place_mouth(mouth_shape(0.3), {300, 200}, 60, 0.1);
  points.pop_back();
  EXPECT_FALSE(order_markers(points, 1.0));  // 15 points
  std::vector<Vector2d> line, ring;
  for (int i = 0; i < 16; ++i) {
    line.emplace_back(10.0 * i, 50.0);
    ring.emplace_back(100 + 50 * std::cos(0.3927 * i), 100 + 50 * std::sin(0.3927 * i));
  }
  EXPECT_FALSE(order_markers(line, 1.0));
  EXPECT_FALSE(order_markers(ring, 1.0));
  EXPECT_FALSE(order_markers(place_mouth(mouth_shape(0.3), {300, 200}, 60, 1.4), 1.0));
}

TEST(MouthLayout, ConstellationIsFoundAmongOtherSpots) {
  Random random(9);
  const auto places = place_mouth(mouth_shape(0.4), {300, 220}, 65, 0.2);
  std::vector<Spot> spots;
  for (const Vector2d& p : places) {
    const auto shade = static_cast<float>(random.uniform(0.9, 1.1));
    spots.push_back(
        {p, 2.5 * random.uniform(0.9, 1.1), shade * Eigen::Vector3f(-0.3f, -0.2f, 0.1f)});
  }
  for (int i = 0; i < 80; ++i) {  // freckles, eyes, buttons: other colours, or far away
    spots.push_back({{random.uniform(0, 640), random.uniform(0, 480)},
                     random.uniform(1.5, 6.0),
                     {static_cast<float>(random.uniform(-0.1, 0.3)), 0.15f, -0.1f}});
  }
  std::reverse(spots.begin(), spots.end());
  const auto found = find_constellation(spots, 16);
  ASSERT_EQ(found.size(), 16u);
  for (std::size_t i = 0; i < 16; ++i) EXPECT_EQ(found[i].centre_px, places[i]) << i;
  EXPECT_TRUE(find_constellation({spots.begin(), spots.begin() + 80}, 16).empty());
}

TEST(MouthLayout, ExchangedMarkersBreakTheOrder) {
  auto places = place_mouth(mouth_shape(0.2), {300, 200}, 60, 0.25);
  std::vector<bool> known(16, true);
  EXPECT_TRUE(in_mouth_order(places, known));
  for (const auto& [a, b] : {std::pair{0, 8}, {1, 9}, {9, 15}, {2, 3}, {13, 14}, {4, 12}}) {
    std::swap(places[a], places[b]);
    EXPECT_FALSE(in_mouth_order(places, known)) << a << " and " << b;
    std::swap(places[a], places[b]);
  }
}

TEST(MouthLayout, MapOfAnAffineMotionIsExact) {
  Eigen::Matrix2d turn;
  turn << 0.9, -0.2, 0.15, 1.3;
  const auto from = place_mouth(mouth_shape(0.2), {300, 200}, 60, 0.0);
  std::vector<Vector2d> to;
  for (const Vector2d& p : from) to.emplace_back(turn * p + Vector2d(5, -3));
  const PlaneMap map = fit_map(from, to);
  EXPECT_LT((map.turn - turn).norm(), 1e-9);
  const PlaneMap shift = fit_map({from[0], from[1]}, {to[0], to[1]});
  EXPECT_TRUE(shift.turn.isIdentity());
  EXPECT_LT((shift.shift - 0.5 * (to[0] + to[1] - from[0] - from[1])).norm(), 1e-9);
}

TEST(Assignment, IsTheBestOfAll) {
  Random random(11);
  for (int trial = 0; trial < 200; ++trial) {
    const int rows = 1 + random.integer(4), columns = rows + random.integer(3);
    Eigen::MatrixXd cost(rows, columns);
    for (double& value : cost.reshaped()) value = random.uniform(-1.0, 1.0);
    std::vector<int> order(static_cast<std::size_t>(columns));
    std::iota(order.begin(), order.end(), 0);
    double least = 1e9;
    do {
      double sum = 0.0;
      for (int i = 0; i < rows; ++i) sum += cost(i, order[static_cast<std::size_t>(i)]);
      least = std::min(least, sum);
    } while (std::next_permutation(order.begin(), order.end()));
    const auto found = assign(cost);
    double sum = 0.0;
    for (int i = 0; i < rows; ++i) sum += cost(i, found[static_cast<std::size_t>(i)]);
    EXPECT_NEAR(sum, least, 1e-12);
    auto taken = found;
    std::sort(taken.begin(), taken.end());
    EXPECT_EQ(std::unique(taken.begin(), taken.end()), taken.end());
  }
}

}  // namespace
}  // namespace semblance
