#include "semblance/lips/mouth_layout.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "median.h"
#include "semblance/geometry/similarity.h"

namespace semblance {
namespace {

using Eigen::Vector2d;

// Markers of the three columns from the top down, and the corners.
constexpr std::array<std::array<int, 4>, 3> kColumns16{
    {{1, 9, 15, 7}, {2, 10, 14, 6}, {3, 11, 13, 5}}};
constexpr std::array<std::array<int, 2>, 3> kColumns8{{{1, 7}, {2, 6}, {3, 5}}};
constexpr double kSteepest = 1.2;  // slope of the line through the corners: 50 degrees
constexpr double kHighest = 1.6;   // of the mouth, in half widths
constexpr double kFromLine = 0.3;  // of an inner corner from the line of the outer ones

/// Coordinates in which the outer corners are (-1, 0) and (1, 0).
class MouthFrame {
 public:
  MouthFrame(const Vector2d& left_px, const Vector2d& right_px)
      : middle_(0.5 * (left_px + right_px)), half_(0.5 * (right_px - left_px)) {}
  Vector2d operator()(const Vector2d& p) const {
    const Vector2d q = (p - middle_) / half_.squaredNorm();
    return {q.dot(half_), half_.x() * q.y() - half_.y() * q.x()};
  }
  double half_width_px() const { return half_.norm(); }

 private:
  Vector2d middle_, half_;
};

using Indices = std::vector<int>;

/// Sorts `chosen` by a coordinate of the points.
void sort_by(Indices& chosen, const std::vector<Vector2d>& points, int axis) {
  std::stable_sort(chosen.begin(), chosen.end(),
                   [&](int a, int b) { return points[a][axis] < points[b][axis]; });
}

/// Whether three dots of one row, from left to right, could lie on a lip.
bool is_row(const Vector2d& left, const Vector2d& middle, const Vector2d& right) {
  constexpr double kMostBend = 0.45, kMostTilt = 0.45;  // in half widths of the mouth
  return std::abs(left.y() + right.y() - 2.0 * middle.y()) < kMostBend &&
         std::abs(left.y() - right.y()) < kMostTilt;
}

/// Fills a contour's places of the columns, of `Rows` dots each; false where they do not stand so.
template <std::size_t Rows>
bool fill_columns(const std::array<std::array<int, Rows>, 3>& columns,
                  const std::vector<Vector2d>& points, Indices inner, double least_gap,
                  Indices& order) {
  sort_by(inner, points, 0);
  std::array<double, 3> middle{}, spread{};
  for (std::size_t c = 0; c < 3; ++c) {
    const auto first = inner.begin() + static_cast<std::ptrdiff_t>(c * Rows);
    Indices column(first, first + static_cast<std::ptrdiff_t>(Rows));
    for (const int i : column) middle[c] += points[i].x() / Rows;
    spread[c] = points[column.back()].x() - points[column.front()].x();
    sort_by(column, points, 1);
    for (std::size_t r = 0; r < Rows; ++r) {
      if (r > 0 && points[column[r]].y() - points[column[r - 1]].y() < least_gap) return false;
      order[columns[c][r]] = column[r];
    }
  }
  for (std::size_t r = 0; r < Rows; ++r) {
    const auto at = [&](std::size_t c) -> const Vector2d& { return points[order[columns[c][r]]]; };
    if (!is_row(at(0), at(1), at(2))) return false;
  }
  const double left = middle[1] - middle[0], right = middle[2] - middle[1];
  const double widest = *std::max_element(spread.begin(), spread.end());
  return std::abs(middle[1]) < 0.3 && left < 2.5 * right && right < 2.5 * left &&
         widest < 0.7 * std::min(left, right);
}

/// The outer corners: of all pairs on a line that is not too steep, the two that are furthest
/// apart.
std::optional<std::pair<int, int>> corners_of(const std::vector<Vector2d>& points) {
  std::optional<std::pair<int, int>> best;
  double furthest = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t j = 0; j < points.size(); ++j) {
      const Vector2d way = points[j] - points[i];
      if (!(way.x() > 0.0) || std::abs(way.y()) > kSteepest * way.x()) continue;
      if (way.squaredNorm() <= furthest) continue;
      furthest = way.squaredNorm();
      best = {static_cast<int>(i), static_cast<int>(j)};
    }
  }
  return best;
}

/// How different two spots look: 0 for equal ones, 1 where they cannot be of one paint.
double unlikeness(const Spot& a, const Spot& b) {
  const double scale = 0.5 * (a.contrast.norm() + b.contrast.norm());
  return (a.contrast - b.contrast).norm() / (0.45 * scale) +
         0.5 * std::abs(std::log(a.radius_px / b.radius_px)) / std::log(1.6);
}

struct Constellation {
  std::vector<Spot> markers;
  double unlikeness = 1e9;
};

/// The spots that look like `seed`, most alike first.
std::vector<Spot> family_of(const Spot& seed, const std::vector<Spot>& spots) {
  std::vector<std::pair<double, const Spot*>> alike;
  for (const Spot& spot : spots) {
    const double distance = (spot.centre_px - seed.centre_px).norm();
    const double unlike = unlikeness(seed, spot);
    if (unlike < 1.3 && distance < 90.0 * seed.radius_px) alike.emplace_back(unlike, &spot);
  }
  std::stable_sort(alike.begin(), alike.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Spot> family;
  for (const auto& [unlike, spot] : alike) family.push_back(*spot);
  return family;
}

/// The constellation with these spots of a family as its outer corners, of the spots between them.
/// Spots too many are left out only where they look less like the others than any that is kept.
std::optional<Constellation> between(const std::vector<Spot>& family, std::size_t left,
                                     std::size_t right, int count) {
  const Vector2d a = family[left].centre_px, b = family[right].centre_px;
  const MouthFrame frame(a, b);
  std::vector<Spot> set = {family[left], family[right]};
  for (std::size_t i = 0; i < family.size(); ++i) {
    const Vector2d q = frame(family[i].centre_px);
    if (i == left || i == right || std::abs(q.x()) >= 1.0 || std::abs(q.y()) > kHighest) continue;
    set.push_back(family[i]);
  }
  const auto wanted = static_cast<std::size_t>(count);
  if (set.size() < wanted) return {};
  const double kept = unlikeness(family.front(), set[wanted - 1]);
  if (set.size() > wanted && unlikeness(family.front(), set[wanted]) < 1.3 * kept + 0.1) return {};
  set.resize(wanted);
  std::vector<Vector2d> points;
  std::vector<double> radii;
  for (const Spot& spot : set) {
    points.push_back(spot.centre_px);
    radii.push_back(spot.radius_px);
  }
  const auto order = order_markers(points, median(radii));
  if (!order) return {};
  Constellation found{{}, 0.0};
  for (const int i : *order) {
    found.markers.push_back(set[static_cast<std::size_t>(i)]);
    found.unlikeness += unlikeness(family.front(), found.markers.back());
  }
  return found;
}

}  // namespace

std::optional<std::vector<int>> order_markers(const std::vector<Eigen::Vector2d>& points_px,
                                              double least_gap_px) {
  const std::size_t count = points_px.size();
  if (count != 8 && count != 16) return {};
  const auto corners = corners_of(points_px);
  if (!corners) return {};
  const MouthFrame frame(points_px[corners->first], points_px[corners->second]);
  std::vector<Vector2d> points;
  for (const Vector2d& p : points_px) points.push_back(frame(p));
  Indices by_x(count);
  std::iota(by_x.begin(), by_x.end(), 0);
  sort_by(by_x, points, 0);
  if (by_x.front() != corners->first || by_x.back() != corners->second) return {};
  Indices order(count, -1), rest(by_x.begin() + 1, by_x.end() - 1);
  order[0] = by_x.front();
  order[4] = by_x.back();
  const double least_gap = least_gap_px / frame.half_width_px();
  if (count == 8)
    return fill_columns(kColumns8, points, rest, least_gap, order) ? std::optional(order)
                                                                   : std::nullopt;
  order[8] = rest.front();
  order[12] = rest.back();
  if (std::max(std::abs(points[order[8]].y()), std::abs(points[order[12]].y())) > kFromLine) {
    return {};
  }
  rest = Indices(rest.begin() + 1, rest.end() - 1);
  if (!fill_columns(kColumns16, points, rest, least_gap, order)) return {};
  return order;
}

std::vector<Spot> find_constellation(const std::vector<Spot>& spots, int count) {
  Constellation best;
  for (const Spot& seed : spots) {
    const std::vector<Spot> family = family_of(seed, spots);
    if (static_cast<int>(family.size()) < count) continue;
    for (std::size_t left = 0; left < family.size(); ++left) {
      for (std::size_t right = 0; right < family.size(); ++right) {
        const Vector2d way = family[right].centre_px - family[left].centre_px;
        const double radius = seed.radius_px;
        if (way.x() < 8.0 * radius || std::abs(way.y()) > kSteepest * way.x()) continue;
        auto found = between(family, left, right, count);
        if (found && found->unlikeness < best.unlikeness) best = std::move(*found);
      }
    }
  }
  return best.markers;
}

bool in_mouth_order(const std::vector<Eigen::Vector2d>& markers_px,
                    const std::vector<bool>& known) {
  // Chains along which one coordinate grows: columns downwards, rows to the right.
  using Chain = std::vector<int>;
  static const std::vector<Chain> down8{{1, 7}, {2, 6}, {3, 5}},
      across8{{0, 1, 2, 3, 4}, {0, 7, 6, 5, 4}};
  static const std::vector<Chain> down16{{1, 9, 15, 7}, {2, 10, 14, 6}, {3, 11, 13, 5}};
  static const std::vector<Chain> across16{
      {0, 8, 9, 10, 11, 12, 4}, {0, 8, 15, 14, 13, 12, 4}, {0, 1, 2, 3, 4}, {0, 7, 6, 5, 4}};
  const bool all = markers_px.size() == 16;
  Vector2d right(1.0, 0.0);
  if (known[0] && known[4]) right = (markers_px[4] - markers_px[0]).normalized();
  const Vector2d below(-right.y(), right.x());
  const auto ascends = [&](const Chain& chain, const Vector2d& way) {
    double last = -1e9;
    for (const int i : chain) {
      if (!known[static_cast<std::size_t>(i)]) continue;
      const double now = way.dot(markers_px[static_cast<std::size_t>(i)]);
      if (now <= last) return false;
      last = now;
    }
    return true;
  };
  const auto& columns = all ? down16 : down8;
  const auto& rows = all ? across16 : across8;
  return std::all_of(columns.begin(), columns.end(),
                     [&](const Chain& c) { return ascends(c, below); }) &&
         std::all_of(rows.begin(), rows.end(), [&](const Chain& c) { return ascends(c, right); });
}

PlaneMap fit_map(const std::vector<Eigen::Vector2d>& from_px,
                 const std::vector<Eigen::Vector2d>& to_px) {
  constexpr std::size_t kAffinePairs = 6;
  Vector2d from = Vector2d::Zero(), to = from;
  const auto count = static_cast<double>(from_px.size());
  for (std::size_t i = 0; i < from_px.size(); ++i) {
    from += from_px[i] / count;
    to += to_px[i] / count;
  }
  PlaneMap map;
  map.shift = to - from;
  if (from_px.size() < kAffinePairs) return map;
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero(), cross = scatter;
  for (std::size_t i = 0; i < from_px.size(); ++i) {
    const Vector2d d = from_px[i] - from;
    scatter += d * d.transpose();
    cross += (to_px[i] - to) * d.transpose();
  }
  // A spread of under a twentieth says nothing of the map across it.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(scatter);
  if (eigen.eigenvalues()[0] < 0.0025 * eigen.eigenvalues()[1]) return map;
  map.turn = cross * scatter.inverse();
  map.shift = to - map.turn * from;
  return map;
}

PlaneMap fit_turn(const std::vector<Eigen::Vector2d>& from_px,
                  const std::vector<Eigen::Vector2d>& to_px) {
  PlaneMap map;
  const auto count = static_cast<Eigen::Index>(from_px.size());
  Eigen::Matrix2Xd from(2, count), to(2, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    from.col(i) = from_px[static_cast<std::size_t>(i)];
    to.col(i) = to_px[static_cast<std::size_t>(i)];
  }
  const Vector2d middle = from.rowwise().mean();
  if (count < 2 || (from.colwise() - middle).squaredNorm() == 0.0) {
    map.shift = to.rowwise().mean() - middle;
    return map;
  }
  const Eigen::Affine2d fitted = fit_similarity(from, to);
  map.turn = fitted.linear();
  map.shift = fitted.translation();
  return map;
}

}  // namespace semblance
