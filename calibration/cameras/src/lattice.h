// Points of a picture as nodes of a lattice, joined from neighbour to neighbour. No camera is
// assumed, so any smooth distortion is followed.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <map>
#include <optional>
#include <utility>
#include <vector>

namespace semblance {

using Cell = std::pair<int, int>;  // column, row

/// Which point lies at which node. Right-handed in the picture: from columns to rows is a turn from
/// x to y.
using Lattice = std::map<Cell, int>;

struct LatticeSeed {
  int point = 0;
  Eigen::Vector2d along_px, across_px;  // to the neighbours in the next column and row
};

/// Whether two points may be neighbours.
using MayAdjoin = std::function<bool(int, int)>;

/// Grows a lattice from a seed: a neighbour is the point nearest to where the nodes known so far
/// predict it, within `tolerance` of the step.
Lattice grow_lattice(const std::vector<Eigen::Vector2d>& points_px, const LatticeSeed& seed,
                     const MayAdjoin& may_adjoin, double tolerance);

/// Where a node that is missing should be, from nodes on both sides or two on one side.
std::optional<Eigen::Vector2d> predict_node(const Lattice& lattice,
                                            const std::vector<Eigen::Vector2d>& points_px,
                                            const Cell& cell);

struct CellRange {
  Cell lower{0, 0}, upper{0, 0};  // both included

  int columns() const { return upper.first - lower.first + 1; }
  int rows() const { return upper.second - lower.second + 1; }
};

CellRange cell_range(const Lattice& lattice);

/// Takes away border lines of which less than `share` is there.
void trim_lattice(Lattice& lattice, double share);

}  // namespace semblance
