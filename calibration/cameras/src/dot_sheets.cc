// Circle grids and dot sheets: ellipses joined to a lattice, then turned to fit the sheet.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "ellipses.h"
#include "sheet_detectors.h"

namespace semblance {

namespace {

using Eigen::Vector2d;

constexpr double kTolerance = 0.3;
constexpr int kMostSeeds = 30;
constexpr double kLargeRadius = 1.25;  // in parts of the smaller dots' radius

/// A lattice's basis from a point's neighbours: the nearest and the next that is not along it.
std::optional<LatticeSeed> seed_at(const std::vector<Vector2d>& points, int from) {
  std::vector<Vector2d> steps;
  for (int i = 0; i < static_cast<int>(points.size()); ++i) {
    if (i != from) steps.push_back(points[i] - points[from]);
  }
  std::sort(steps.begin(), steps.end(),
            [](const Vector2d& a, const Vector2d& b) { return a.squaredNorm() < b.squaredNorm(); });
  for (std::size_t i = 1; i < std::min<std::size_t>(steps.size(), 8); ++i) {
    const double cross = steps[0].x() * steps[i].y() - steps[0].y() * steps[i].x();
    if (std::abs(cross) < 0.5 * steps[0].norm() * steps[i].norm()) continue;
    return LatticeSeed{from, steps[0], cross > 0.0 ? steps[i] : Vector2d(-steps[i])};
  }
  return std::nullopt;
}

/// A change of the lattice's basis: quarter turns, a mirror, and a shear where a tilted sheet has a
/// diagonal shorter than a side.
struct BasisChange {
  int quarters = 0, shear = 0;
  bool mirrored = false;
};

Lattice changed(const Lattice& lattice, const BasisChange& change) {
  Lattice result;
  for (const auto& [cell, point] : lattice) {
    const int column = change.mirrored ? -cell.first : cell.first;
    result[{column + change.shear * cell.second, cell.second}] = point;
  }
  return turned(result, change.quarters);
}

std::vector<BasisChange> basis_changes(bool mirrored) {
  std::vector<BasisChange> changes;
  for (const int shear : {0, 1, -1}) {
    for (int quarters = 0; quarters < 4; ++quarters) changes.push_back({quarters, shear, mirrored});
  }
  return changes;
}

std::map<Cell, int> cells_of(const Target& target) {
  std::map<Cell, int> cells;
  for (int row = 0; row < target.rows; ++row) {
    for (int column = 0; column < target.columns; ++column) {
      const Cell cell = target.asymmetric ? asymmetric_cell(column, row) : Cell{column, row};
      cells[cell] = column + target.columns * row;
    }
  }
  // As `turned` leaves a lattice: from 0.
  return turned(cells, 0);
}

bool same_cells(const Lattice& a, const Lattice& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(),
                                            [](auto& x, auto& y) { return x.first == y.first; });
}

using DotsById = std::map<int, int>;

void set_dots(Detection& detection, const DotLattice& dots, const DotsById& dot_of_id) {
  PointsById points;
  detection.radii_px.clear();
  for (const auto& [id, dot] : dot_of_id) {
    points[id] = dots.centres_px[dot];
    detection.radii_px.push_back(dots.radii_px[dot]);
  }
  set_points(detection, points);
}

/// The ways in which the whole sheet fits the lattice.
std::vector<DotsById> fits_of(const DotLattice& dots, const Lattice& sheet, bool mirrored) {
  std::vector<DotsById> fits;
  for (const BasisChange& change : basis_changes(mirrored)) {
    const Lattice lattice = changed(dots.lattice, change);
    if (!same_cells(lattice, sheet)) continue;
    DotsById dot_of_id;
    for (const auto& [cell, point] : lattice) dot_of_id[sheet.at(cell)] = point;
    fits.push_back(std::move(dot_of_id));
  }
  return fits;
}

/// Nodes that are larger than their neighbours in the lattice.
std::vector<Cell> large_nodes(const DotLattice& dots) {
  std::vector<Cell> large;
  for (const auto& [cell, point] : dots.lattice) {
    // Against the smaller ones nearby, so that perspective does not matter.
    std::vector<double> radii;
    for (int dy = -2; dy <= 2; ++dy) {
      for (int dx = -2; dx <= 2; ++dx) {
        const auto other = dots.lattice.find({cell.first + dx, cell.second + dy});
        if (other != dots.lattice.end()) radii.push_back(dots.radii_px[other->second]);
      }
    }
    std::nth_element(radii.begin(), radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 3),
                     radii.end());
    if (dots.radii_px[point] > kLargeRadius * radii[radii.size() / 3]) large.push_back(cell);
  }
  return large;
}

/// The lattice in the sheet's columns and rows where its three large dots are found.
std::optional<Lattice> named_by_large_dots(const DotLattice& dots, const Target& target,
                                           bool mirrored) {
  const std::vector<Eigen::Vector2i> places = large_dots(target);
  for (const BasisChange& change : basis_changes(mirrored)) {
    DotLattice view{dots.centres_px, dots.radii_px, changed(dots.lattice, change)};
    const std::vector<Cell> large = large_nodes(view);
    if (large.size() != places.size()) continue;
    const std::set<Cell> cells(large.begin(), large.end());
    for (const Cell& middle : large) {
      const Cell shift{places[0].x() - middle.first, places[0].y() - middle.second};
      const bool all = std::all_of(places.begin(), places.end(), [&](const Eigen::Vector2i& p) {
        return cells.count({p.x() - shift.first, p.y() - shift.second}) > 0;
      });
      if (!all) continue;
      Lattice named;
      for (const auto& [cell, point] : view.lattice) {
        named[{cell.first + shift.first, cell.second + shift.second}] = point;
      }
      return named;
    }
  }
  return std::nullopt;
}

void warn(Detection& detection, DetectionWarning::Kind kind, std::string text) {
  detection.warnings.push_back({kind, std::move(text)});
}

}  // namespace

Cell asymmetric_cell(int column, int row) {
  // x + y and y - x of a circle are both even or both odd with 2 (x = 2 column + row mod 2, y =
  // row), so halves of them number the diagonals. Turned this way the basis stays right-handed.
  const int x = 2 * column + row % 2;
  return {(x + row) / 2, (row - x) / 2};
}

DotLattice find_dot_lattice(const cv::Mat& grey) {
  DotLattice dots;
  for (const Ellipse& e : find_ellipses(grey)) {
    dots.centres_px.push_back(e.centre_px);
    dots.radii_px.push_back(e.radius_px());
  }
  const auto may_adjoin = [&](int a, int b) {
    const double ratio = dots.radii_px[a] / dots.radii_px[b];
    return ratio > 0.45 && ratio < 2.2;
  };
  std::vector<bool> tried(dots.centres_px.size(), false);
  int seeds = 0;
  for (int i = 0; i < static_cast<int>(tried.size()) && seeds < kMostSeeds; ++i) {
    if (tried[i]) continue;
    const auto seed = seed_at(dots.centres_px, i);
    if (!seed) continue;
    ++seeds;
    Lattice lattice = grow_lattice(dots.centres_px, *seed, may_adjoin, kTolerance);
    for (const auto& [cell, point] : lattice) tried[point] = true;
    if (lattice.size() > dots.lattice.size()) dots.lattice = std::move(lattice);
  }
  return dots;
}

void detect_circles(const DotLattice& dots, Detection& detection) {
  using Kind = DetectionWarning::Kind;
  const Target& target = detection.target;
  const Lattice sheet = cells_of(target);
  const std::vector<DotsById> fits = fits_of(dots, sheet, false);
  if (fits.empty()) {
    if (!fits_of(dots, sheet, true).empty()) {
      warn(detection, Kind::mirrored, "the picture shows the sheet's mirror image: flip it");
    } else if (2 * dots.lattice.size() > sheet.size()) {
      warn(detection, dots.lattice.size() < sheet.size() ? Kind::incomplete : Kind::wrong_counts,
           fmt::format("{} circles on a grid are seen, which are not the sheet's {}: it has to be "
                       "seen whole",
                       dots.lattice.size(), sheet.size()));
    }
    return;
  }
  const auto height = [&](const DotsById& fit) { return dots.centres_px[fit.at(0)].sum(); };
  const auto uppermost = std::min_element(fits.begin(), fits.end(),
                                          [&](auto& a, auto& b) { return height(a) < height(b); });
  set_dots(detection, dots, *uppermost);
  if (fits.size() > 1) {
    warn(detection, Kind::half_turn,
         "the sheet looks the same after a turn: the end that is uppermost was taken for its upper "
         "left. An asymmetric grid with an odd count of rows has no such doubt");
  }
}

void detect_dots(const DotLattice& dots, Detection& detection) {
  using Kind = DetectionWarning::Kind;
  const Target& target = detection.target;
  const auto named = named_by_large_dots(dots, target, false);
  if (!named) {
    if (named_by_large_dots(dots, target, true)) {
      warn(detection, Kind::mirrored, "the picture shows the sheet's mirror image: flip it");
    } else if (2 * dots.lattice.size() > static_cast<std::size_t>(target.columns) * target.rows) {
      warn(detection, Kind::incomplete,
           fmt::format("{} dots on a grid are seen, but not the three large ones that name them",
                       dots.lattice.size()));
    }
    return;
  }
  DotsById dot_of_id;
  const CellRange range = cell_range(*named);
  if (range.lower.first < 0 || range.lower.second < 0 || range.upper.first >= target.columns ||
      range.upper.second >= target.rows) {
    warn(detection, Kind::wrong_counts,
         fmt::format("dots beyond the sheet's {}x{} are seen", target.columns, target.rows));
    return;
  }
  for (const auto& [cell, point] : *named) {
    dot_of_id[cell.first + target.columns * cell.second] = point;
  }
  set_dots(detection, dots, dot_of_id);
}

}  // namespace semblance
