#include "lattice.h"

#include <array>
#include <deque>
#include <limits>
#include <set>

namespace semblance {

namespace {

constexpr std::array<Cell, 4> kSides = {{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};

Cell moved(const Cell& cell, const Cell& by, int times = 1) {
  return {cell.first + times * by.first, cell.second + times * by.second};
}

class Grower {
 public:
  Grower(const std::vector<Eigen::Vector2d>& points_px, const LatticeSeed& seed,
         const MayAdjoin& may_adjoin, double tolerance)
      : points_px_(points_px), seed_(seed), may_adjoin_(may_adjoin), tolerance_(tolerance) {}

  Lattice grow() {
    place({0, 0}, seed_.point);
    // Nodes are asked again after their surroundings have grown: a later prediction is a better
    // one.
    while (!open_.empty()) {
      const Cell cell = open_.front();
      open_.pop_front();
      for (const Cell& side : kSides) extend(cell, side);
    }
    return lattice_;
  }

 private:
  const Eigen::Vector2d* at(const Cell& cell) const {
    const auto node = lattice_.find(cell);
    return node == lattice_.end() ? nullptr : &points_px_[node->second];
  }

  void place(const Cell& cell, int point) {
    lattice_[cell] = point;
    used_.insert(point);
    open_.push_back(cell);
    for (const Cell& side : kSides) {
      if (at(moved(cell, side))) open_.push_back(moved(cell, side));
    }
  }

  /// The step from a node to its neighbour: as on the other side, as in the lines beside it, or as
  /// the seed says.
  std::optional<Eigen::Vector2d> step(const Cell& cell, const Cell& side) const {
    const Eigen::Vector2d& here = *at(cell);
    if (const auto* behind = at(moved(cell, side, -1))) {
      const auto* second = at(moved(cell, side, -2));
      const Eigen::Vector2d last = here - *behind;
      // Steps of a row shrink or grow steadily under perspective and distortion.
      return second ? Eigen::Vector2d(2.0 * last - (*behind - *second)) : last;
    }
    const Cell across{side.second, side.first};
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    int count = 0;
    for (const int sign : {1, -1}) {
      const auto* from = at(moved(cell, across, sign));
      const auto* to = at(moved(moved(cell, across, sign), side));
      if (!from || !to) continue;
      sum += *to - *from;
      ++count;
    }
    if (count > 0) return Eigen::Vector2d(sum / count);
    if (lattice_.size() > 3) return std::nullopt;
    return Eigen::Vector2d(side.first * seed_.along_px + side.second * seed_.across_px);
  }

  void extend(const Cell& cell, const Cell& side) {
    const Cell next = moved(cell, side);
    if (lattice_.count(next)) return;
    const auto by = step(cell, side);
    if (!by) return;
    const int from = lattice_.at(cell);
    const Eigen::Vector2d there = points_px_[from] + *by;
    int best = -1;
    double nearest = tolerance_ * by->norm();
    for (int i = 0; i < static_cast<int>(points_px_.size()); ++i) {
      const double distance = (points_px_[i] - there).norm();
      if (distance < nearest && !used_.count(i) && may_adjoin_(from, i)) {
        nearest = distance;
        best = i;
      }
    }
    if (best >= 0) place(next, best);
  }

  const std::vector<Eigen::Vector2d>& points_px_;
  const LatticeSeed& seed_;
  const MayAdjoin& may_adjoin_;
  double tolerance_;
  Lattice lattice_;
  std::set<int> used_;
  std::deque<Cell> open_;
};

}  // namespace

Lattice grow_lattice(const std::vector<Eigen::Vector2d>& points_px, const LatticeSeed& seed,
                     const MayAdjoin& may_adjoin, double tolerance) {
  return Grower(points_px, seed, may_adjoin, tolerance).grow();
}

std::optional<Eigen::Vector2d> predict_node(const Lattice& lattice,
                                            const std::vector<Eigen::Vector2d>& points_px,
                                            const Cell& cell) {
  const auto at = [&](const Cell& c) -> const Eigen::Vector2d* {
    const auto node = lattice.find(c);
    return node == lattice.end() ? nullptr : &points_px[node->second];
  };
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  int count = 0;
  for (const Cell& side : kSides) {
    const auto* next = at(moved(cell, side));
    const auto* second = at(moved(cell, side, 2));
    const auto* third = at(moved(cell, side, 3));
    if (!next || !second) continue;
    sum += third ? Eigen::Vector2d(3.0 * (*next - *second) + *third)
                 : Eigen::Vector2d(2.0 * *next - *second);
    ++count;
  }
  if (count == 0) return std::nullopt;
  return Eigen::Vector2d(sum / count);
}

CellRange cell_range(const Lattice& lattice) {
  constexpr int most = std::numeric_limits<int>::max();
  CellRange range{{most, most}, {-most, -most}};
  for (const auto& [cell, point] : lattice) {
    range.lower = {std::min(range.lower.first, cell.first),
                   std::min(range.lower.second, cell.second)};
    range.upper = {std::max(range.upper.first, cell.first),
                   std::max(range.upper.second, cell.second)};
  }
  return range;
}

void trim_lattice(Lattice& lattice, double share) {
  for (bool changed = true; changed && !lattice.empty();) {
    changed = false;
    const CellRange range = cell_range(lattice);
    std::map<int, int> in_column, in_row;
    for (const auto& [cell, point] : lattice) {
      ++in_column[cell.first];
      ++in_row[cell.second];
    }
    const auto thin_column = [&](int c) { return in_column[c] < share * range.rows(); };
    const auto thin_row = [&](int r) { return in_row[r] < share * range.columns(); };
    const auto drop = [&](const auto& outside) {
      std::erase_if(lattice, [&](const auto& node) { return outside(node.first); });
      changed = true;
    };
    for (const int c : {range.lower.first, range.upper.first}) {
      if (!changed && thin_column(c)) drop([c](const Cell& cell) { return cell.first == c; });
    }
    for (const int r : {range.lower.second, range.upper.second}) {
      if (!changed && thin_row(r)) drop([r](const Cell& cell) { return cell.second == r; });
    }
  }
}

}  // namespace semblance
