#include "auto_target.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "charuco_layout.h"
#include "sheet_detectors.h"
#include "sheet_warp.h"

namespace semblance {

namespace {

using Eigen::Vector2d;

constexpr std::size_t kLeastQuads = 4;
constexpr std::size_t kLeastDots = 12;
constexpr int kMostRows = 30;

/// How markers follow each other, in parts of a marker's side, read from pairs of neighbours.
struct MarkerGrid {
  double step = 0.0;  // from a marker to the next id, which is to its right
  int stride = 0;     // of the ids, from a marker to the one `step` below or above it
};

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Centres of other quads as one quad sees them: x to its right, y up, side 1.
std::vector<std::pair<int, Vector2d>> seen_from(const NamedQuad& from,
                                                const std::vector<NamedQuad>& quads,
                                                const std::array<Vector2d, 4>& unit) {
  const std::vector<Vector2d> image(from.corners_px.begin(), from.corners_px.end());
  const Eigen::Matrix3d h = fit_homography(image, {unit.begin(), unit.end()});
  std::vector<std::pair<int, Vector2d>> others;
  for (const NamedQuad& quad : quads) {
    if (quad.id == from.id) continue;
    Vector2d centre = Vector2d::Zero();
    for (const Vector2d& corner : quad.corners_px) centre += 0.25 * corner;
    others.emplace_back(quad.id - from.id, (h * centre.homogeneous()).hnormalized());
  }
  return others;
}

std::optional<MarkerGrid> read_grid(const std::vector<NamedQuad>& quads,
                                    const std::array<Vector2d, 4>& unit) {
  std::vector<double> steps;
  for (const NamedQuad& from : quads) {
    for (const auto& [ids, place] : seen_from(from, quads, unit)) {
      if (ids == 1 && std::abs(place.y()) < 0.3 && place.x() > 1.0 && place.x() < 6.0) {
        steps.push_back(place.x());
      }
    }
  }
  if (steps.empty()) return std::nullopt;
  MarkerGrid grid;
  grid.step = median(steps);
  std::map<int, int> votes;
  for (const NamedQuad& from : quads) {
    for (const auto& [ids, place] : seen_from(from, quads, unit)) {
      if (std::abs(place.x()) < 0.3 * grid.step &&
          std::abs(std::abs(place.y()) - grid.step) < 0.3 * grid.step) {
        ++votes[std::abs(ids)];
      }
    }
  }
  if (votes.empty()) return std::nullopt;
  grid.stride = std::max_element(votes.begin(), votes.end(), [](auto& a, auto& b) {
                  return a.second < b.second;
                })->first;
  return grid;
}

double rounded(double value, double parts) { return std::round(value * parts) / parts; }

/// The sheet's points that are found when it is taken for `target`.
std::size_t points_of(const cv::Mat& grey, const std::vector<NamedQuad>& quads,
                      const Target& target, bool inverted) {
  Detection detection;
  detection.target = target;
  detection.inverted = inverted;
  if (target.kind == TargetKind::aprilgrid) {
    detect_aprilgrid(grey, quads, detection);
  } else {
    detect_charuco(grey, quads, detection);
  }
  return detection.ids.size();
}

/// The gap that fits the corners best: blur widens outlines, and with them what `read_grid` says.
double fitted_gap(const cv::Mat& grey, const std::vector<NamedQuad>& quads, Target target) {
  Detection detection;
  detection.target = target;
  detect_aprilgrid(grey, quads, detection);
  std::vector<Vector2d> image;
  for (const auto& point : detection.points_px.colwise()) image.push_back(point);
  double best = target.gap_ratio;
  double least = 1e300;
  for (int hundredths = -8; hundredths <= 8; ++hundredths) {
    Target candidate = target;
    candidate.gap_ratio = rounded(target.gap_ratio + 0.01 * hundredths, 100.0);
    if (candidate.gap_ratio <= 0.0) continue;
    std::vector<Vector2d> sheet;
    for (const int id : detection.ids) sheet.push_back(point_on_sheet(candidate, id).head<2>());
    const Eigen::Matrix3d h = fit_homography(sheet, image);
    double sum = 0.0;
    for (std::size_t i = 0; i < sheet.size(); ++i) {
      sum += ((h * sheet[i].homogeneous()).hnormalized() - image[i]).squaredNorm();
    }
    if (sum < least) {
      least = sum;
      best = candidate.gap_ratio;
    }
  }
  return best;
}

Target identify_aprilgrid(const cv::Mat& grey, double size_m, bool& assumed) {
  // libapriltag's corners on a tag of side 1 with y up.
  const std::array<Vector2d, 4> unit = {{{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}}};
  for (const int border : {1, 2}) {
    TagDetector detector({border, 1.0f, true});
    const std::vector<NamedQuad> quads = find_tags(grey, detector);
    if (quads.size() < kLeastQuads) continue;
    const auto grid = read_grid(quads, unit);
    if (!grid || grid->stride < 1) continue;
    int least = quads[0].id, most = quads[0].id;
    for (const NamedQuad& quad : quads) {
      least = std::min(least, quad.id);
      most = std::max(most, quad.id);
    }
    Target target;
    target.kind = TargetKind::aprilgrid;
    target.columns = grid->stride;
    target.size_m = size_m;
    target.gap_ratio = rounded(grid->step - 1.0, 100.0);
    target.border_bits = border;
    target.first_id = least / target.columns < 2 ? 0 : least;
    target.rows = (most - target.first_id) / target.columns + 1;
    if (target.first_id + target.rows * target.columns > 587) continue;
    // Where other sheets are in the picture too, this one ends before the first id of theirs.
    for (const std::size_t all = points_of(grey, quads, target, false); target.rows > 1;) {
      Target smaller = target;
      --smaller.rows;
      if (points_of(grey, quads, smaller, false) < all) break;
      target = smaller;
    }
    target.gap_ratio = fitted_gap(grey, quads, target);
    assumed = points_of(grey, quads, target, false) < point_ids(target).size();
    return target;
  }
  return {};
}

Target identify_charuco(const cv::Mat& grey, double size_m, bool& assumed) {
  const std::array<Vector2d, 4> unit = {{{-0.5, 0.5}, {0.5, 0.5}, {0.5, -0.5}, {-0.5, -0.5}}};
  for (const char* dictionary : {"DICT_4X4_1000", "DICT_5X5_1000", "DICT_6X6_1000", "DICT_7X7_1000",
                                 "DICT_ARUCO_ORIGINAL"}) {
    bool inverted = false;
    const std::vector<NamedQuad> quads = find_aruco(grey, dictionary, inverted);
    if (quads.size() < kLeastQuads) continue;
    const auto grid = read_grid(quads, unit);
    // Markers of a row are two squares apart, and two rows hold as many as there are columns.
    if (!grid || grid->stride < 2 || grid->step < 2.0) continue;
    // OpenCV's outlines run through the outermost pixels' centres: a side is a pixel short.
    std::vector<double> sides_px;
    for (const NamedQuad& quad : quads) {
      sides_px.push_back((quad.corners_px[1] - quad.corners_px[0]).norm());
    }
    const double widening = 1.0 + 1.0 / median(sides_px);
    Target best;
    std::size_t most_points = 0;
    for (const bool legacy : {false, true}) {
      Target target;
      target.kind = TargetKind::charuco;
      target.columns = grid->stride;
      target.size_m = size_m;
      target.marker_m = size_m * std::min(0.99, rounded(2.0 / grid->step * widening, 20.0));
      target.dictionary = dictionary;
      target.legacy = legacy;
      // As many rows as the largest id among those that agree needs; the older layout differs for
      // even counts alone.
      for (target.rows = 2; target.rows <= kMostRows; ++target.rows) {
        if (most_points > 0 && target.rows > best.rows + 3) break;
        if (legacy && target.rows % 2 == 1) continue;
        const std::size_t points = points_of(grey, quads, target, inverted);
        if (points <= most_points) continue;
        most_points = points;
        best = target;
      }
    }
    if (most_points < 4) continue;
    assumed = most_points < point_ids(best).size();
    return best;
  }
  return {};
}

Target identify_chessboard(const cv::Mat& grey, double size_m) {
  const ChessLattice board = find_chess_lattice(grey, 0, 0);
  const CellRange range = cell_range(board.lattice);
  if (!board.complete() || std::min(range.columns(), range.rows()) < 3) return {};
  Target target;
  target.kind = TargetKind::chessboard;
  target.columns = std::max(range.columns(), range.rows());
  target.rows = std::min(range.columns(), range.rows());
  target.size_m = size_m;
  return target;
}

std::size_t points_of(const DotLattice& dots, const Target& target) {
  Detection detection;
  detection.target = target;
  if (target.kind == TargetKind::dots) {
    detect_dots(dots, detection);
  } else {
    detect_circles(dots, detection);
  }
  return detection.ids.size();
}

/// Every sheet with as many dots as the lattice holds, until one fits.
Target identify_dots(const cv::Mat& grey, double size_m) {
  const DotLattice dots = find_dot_lattice(grey);
  const int count = static_cast<int>(dots.lattice.size());
  if (dots.lattice.size() < kLeastDots) return {};
  for (const TargetKind kind : {TargetKind::dots, TargetKind::circles}) {
    for (int rows = 2; rows <= count / 2; ++rows) {
      if (count % rows != 0 || (kind == TargetKind::dots && (rows < 3 || count / rows < 4)))
        continue;
      for (const bool asymmetric : {false, true}) {
        Target target;
        target.kind = kind;
        target.columns = count / rows;
        target.rows = rows;
        target.size_m = size_m;
        target.asymmetric = asymmetric;
        if (kind == TargetKind::dots && asymmetric) continue;
        if (kind == TargetKind::circles && !asymmetric && rows > target.columns) continue;
        if (points_of(dots, target) == dots.lattice.size()) return target;
      }
    }
  }
  return {};
}

}  // namespace

Target identify_sheet(const cv::Mat& grey, double size_m, bool& assumed) {
  assumed = false;
  Target target = identify_aprilgrid(grey, size_m, assumed);
  if (target.kind == TargetKind::automatic) target = identify_charuco(grey, size_m, assumed);
  if (target.kind == TargetKind::automatic) target = identify_chessboard(grey, size_m);
  if (target.kind == TargetKind::automatic) target = identify_dots(grey, size_m);
  return target;
}

}  // namespace semblance
