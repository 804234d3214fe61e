// Chessboards: saddle points joined to a lattice.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "sheet_detectors.h"

namespace semblance {

namespace {

using Eigen::Vector2d;

constexpr int kSearchSide = 1000;  // pictures are searched at about this size first
constexpr std::size_t kMostSaddles = 1500;
constexpr int kMostSeeds = 40;
constexpr double kTolerance = 0.3;  // of a step
constexpr double kBorderShare = 0.6;
constexpr int kLargestWindow = 12;
constexpr double kFitRadius = 8.0;

bool may_adjoin(const SaddleLook& a, const SaddleLook& b) {
  // Neighbours have their bright fields across from each other's.
  const double turn = angle_between_axes(a.bright_rad, b.bright_rad);
  const double ratio = a.contrast / b.contrast;
  return turn > std::numbers::pi / 2 - 0.7 && ratio > 0.25 && ratio < 4.0;
}

/// The step to the nearest saddle along an edge of saddle `from`.
std::optional<Vector2d> step_along(const std::vector<Vector2d>& points,
                                   const std::vector<SaddleLook>& looks, int from,
                                   double edge_rad) {
  std::optional<Vector2d> nearest;
  for (int i = 0; i < static_cast<int>(points.size()); ++i) {
    const Vector2d step = points[i] - points[from];
    if (i == from || (nearest && step.norm() >= nearest->norm())) continue;
    if (angle_between_axes(std::atan2(step.y(), step.x()), edge_rad) > 0.25) continue;
    if (may_adjoin(looks[from], looks[i])) nearest = step;
  }
  return nearest;
}

std::optional<LatticeSeed> seed_at(const std::vector<Vector2d>& points,
                                   const std::vector<SaddleLook>& looks, int from) {
  auto along = step_along(points, looks, from, looks[from].edges_rad[0]);
  auto across = step_along(points, looks, from, looks[from].edges_rad[1]);
  if (!along || !across) return std::nullopt;
  const double ratio = along->norm() / across->norm();
  if (ratio < 0.2 || ratio > 5.0) return std::nullopt;
  if (along->x() * across->y() - along->y() * across->x() < 0.0) *across = -*across;
  return LatticeSeed{from, *along, *across};
}

/// The least distance from a node to its neighbours.
double least_step(const ChessLattice& board, const Cell& cell) {
  const auto node = board.lattice.find(cell);
  double least = 1e9;
  for (const Cell& side : {Cell{1, 0}, Cell{0, 1}, Cell{-1, 0}, Cell{0, -1}}) {
    const auto next = board.lattice.find({cell.first + side.first, cell.second + side.second});
    if (next == board.lattice.end()) continue;
    least = std::min(least, (board.points_px[next->second] - board.points_px[node->second]).norm());
  }
  return least;
}

int window_for(double step_px) {
  return std::clamp(static_cast<int>(std::lround(0.3 * step_px)), 2, kLargestWindow);
}

/// Looks for a node at the place its neighbours predict.
bool add_predicted(const cv::Mat& grey, const Cell& cell, ChessLattice& board) {
  const auto predicted = predict_node(board.lattice, board.points_px, cell);
  if (!predicted) return false;
  double step = 1e9;
  int neighbour = -1;
  for (const auto& [other, point] : board.lattice) {
    const double distance = (board.points_px[point] - *predicted).norm();
    if (distance >= step) continue;
    step = distance;
    neighbour = point;
  }
  const auto place = refine_saddle(grey, point_of(*predicted), window_for(step), 0.25 * step);
  if (!place) return false;
  const auto look = look_at_saddle(grey, *place, std::max(2.5, 0.2 * step));
  const Vector2d found = vector_of(*place);
  const auto neighbour_cell =
      std::find_if(board.lattice.begin(), board.lattice.end(), [&](const auto& node) {
        return node.second == neighbour;
      })->first;
  const bool adjacent =
      std::abs(neighbour_cell.first - cell.first) + std::abs(neighbour_cell.second - cell.second) ==
      1;
  if (!look || (adjacent && !may_adjoin(board.looks[neighbour], *look))) return false;
  board.lattice[cell] = static_cast<int>(board.points_px.size());
  board.points_px.push_back(found);
  board.looks.push_back(*look);
  return true;
}

/// Fills holes, and searches one line beyond each border as long as that finds enough.
void complete_lattice(const cv::Mat& grey, ChessLattice& board) {
  for (int round = 0; round < 3; ++round) {
    const CellRange range = cell_range(board.lattice);
    int added = 0;
    for (int r = range.lower.second - 1; r <= range.upper.second + 1; ++r) {
      for (int c = range.lower.first - 1; c <= range.upper.first + 1; ++c) {
        if (!board.lattice.count({c, r})) added += add_predicted(grey, {c, r}, board) ? 1 : 0;
      }
    }
    trim_lattice(board.lattice, kBorderShare);
    if (added == 0 || board.complete()) return;
  }
}

ChessLattice search_level(const cv::Mat& grey, int columns, int rows) {
  ChessLattice best;
  std::vector<Vector2d> points;
  std::vector<SaddleLook> looks;
  for (const Saddle& saddle : find_saddles(grey, kMostSaddles)) {
    points.push_back(vector_of(saddle.place));
    looks.push_back(saddle.look);
  }
  std::vector<bool> tried(points.size(), false);
  int seeds = 0;
  for (int i = 0; i < static_cast<int>(points.size()) && seeds < kMostSeeds; ++i) {
    if (tried[i]) continue;
    const auto seed = seed_at(points, looks, i);
    if (!seed) continue;
    ++seeds;
    ChessLattice board{
        points, looks,
        grow_lattice(
            points, *seed, [&](int a, int b) { return may_adjoin(looks[a], looks[b]); },
            kTolerance)};
    for (const auto& [cell, point] : board.lattice) tried[point] = true;
    trim_lattice(board.lattice, kBorderShare);
    if (board.lattice.size() < 4 || board.lattice.size() <= best.lattice.size()) continue;
    complete_lattice(grey, board);
    best = std::move(board);
    const CellRange range = cell_range(best.lattice);
    if (best.complete() &&
        std::minmax({range.columns(), range.rows()}) == std::minmax({columns, rows})) {
      break;
    }
  }
  return best;
}

void refine_nodes(const cv::Mat& grey, double scale, ChessLattice& board) {
  for (Vector2d& p : board.points_px) p = (p.array() + 0.5) * scale - 0.5;
  std::vector<std::pair<int, Vector2d>> refined;
  for (const auto& [cell, point] : board.lattice) {
    const double step = least_step(board, cell);
    const auto place = refine_saddle(grey, point_of(board.points_px[point]), window_for(step),
                                     std::max(2.0 * scale, 0.1 * step));
    if (!place) continue;
    // Perspective and distortion bend the edges of a wide window; noise asks for a wide one.
    const double radius = std::clamp(0.35 * step, 3.0, kFitRadius);
    const auto fitted = fit_saddle(grey, *place, board.looks[point], radius, 1.5);
    refined.emplace_back(point, vector_of(fitted.value_or(*place)));
  }
  for (const auto& [point, place] : refined) board.points_px[point] = place;
}

/// How well the fields' brightness agrees with a black square in the upper left: -1 to 1.
double colour_agreement(const ChessLattice& board, const Lattice& lattice) {
  double sum = 0.0;
  int count = 0;
  for (const auto& [cell, point] : lattice) {
    const auto right = lattice.find({cell.first + 1, cell.second});
    const auto below = lattice.find({cell.first, cell.second + 1});
    if (right == lattice.end() || below == lattice.end()) continue;
    const Vector2d& here = board.points_px[point];
    const Vector2d x = (board.points_px[right->second] - here).normalized();
    const Vector2d y = (board.points_px[below->second] - here).normalized();
    const bool even = (cell.first + cell.second) % 2 == 0;
    const Vector2d bright = even ? Vector2d(x - y) : Vector2d(x + y);
    sum += std::cos(2.0 * (board.looks[point].bright_rad - std::atan2(bright.y(), bright.x())));
    ++count;
  }
  return count > 0 ? sum / count : 0.0;
}

/// The turns of the lattice that fit counts and colours, the one whose origin is uppermost first.
Lattice upright(const ChessLattice& board, int columns, int rows) {
  Lattice best;
  bool best_fits = false;
  double best_place = 0.0;
  for (int quarters = 0; quarters < 4; ++quarters) {
    const Lattice candidate = turned(board.lattice, quarters);
    const CellRange range = cell_range(candidate);
    if (range.columns() != columns || range.rows() != rows) continue;
    const bool fits = colour_agreement(board, candidate) > 0.0;
    const double place = board.points_px[candidate.at({0, 0})].sum();
    if (best.empty() || (fits && !best_fits) || (fits == best_fits && place < best_place)) {
      best = candidate;
      best_fits = fits;
      best_place = place;
    }
  }
  return best;
}

}  // namespace

bool ChessLattice::complete() const {
  const CellRange range = cell_range(lattice);
  return !lattice.empty() &&
         lattice.size() == static_cast<std::size_t>(range.columns()) * range.rows();
}

Lattice turned(const Lattice& lattice, int quarters) {
  Lattice result;
  for (const auto& [cell, point] : lattice) {
    Cell c = cell;
    for (int q = 0; q < quarters; ++q) c = {c.second, -c.first};
    result[c] = point;
  }
  const Cell lower = cell_range(result).lower;
  Lattice shifted;
  for (const auto& [cell, point] : result) {
    shifted[{cell.first - lower.first, cell.second - lower.second}] = point;
  }
  return shifted;
}

ChessLattice find_chess_lattice(const cv::Mat& grey, int columns, int rows) {
  ChessLattice best;
  // At the usual size first, then finer for small squares, then coarser for blurred ones.
  const int usual = std::max(1, std::max(grey.cols, grey.rows) / kSearchSide);
  std::vector<int> scales = {usual, 2 * usual};
  if (usual > 1) scales.insert(scales.begin() + 1, 1);
  for (const int scale : scales) {
    cv::Mat level = grey;
    if (scale > 1) {
      cv::resize(grey, level, {grey.cols / scale, grey.rows / scale}, 0, 0, cv::INTER_AREA);
    }
    ChessLattice board = search_level(level, columns, rows);
    refine_nodes(grey, static_cast<double>(grey.cols) / level.cols, board);
    if (board.lattice.size() > best.lattice.size()) best = std::move(board);
    const CellRange range = cell_range(best.lattice);
    if (best.complete() && range.columns() * range.rows() >= columns * rows) break;
  }
  return best;
}

void detect_chessboard(const cv::Mat& grey, Detection& detection) {
  const Target& target = detection.target;
  const ChessLattice board = find_chess_lattice(grey, target.columns, target.rows);
  if (board.lattice.empty()) return;
  const CellRange range = cell_range(board.lattice);
  const auto [fewer, more] = std::minmax({range.columns(), range.rows()});
  using Kind = DetectionWarning::Kind;
  if (std::minmax({target.columns, target.rows}) != std::pair(fewer, more)) {
    if (board.complete() && fewer >= 3) {
      detection.warnings.push_back(
          {Kind::wrong_counts,
           fmt::format("a board of {}x{} inner corners is seen instead of {}x{}: is it covered in "
                       "part, or are the counts wrong (squares less one)?",
                       more, fewer, target.columns, target.rows)});
    }
    return;
  }
  if (!board.complete()) {
    detection.warnings.push_back(
        {Kind::incomplete,
         fmt::format("{} of {} corners are seen; a chessboard has to be seen whole",
                     board.lattice.size(), target.columns * target.rows)});
    return;
  }
  PointsById points;
  for (const auto& [cell, point] : upright(board, target.columns, target.rows)) {
    points[cell.first + target.columns * cell.second] = board.points_px[point];
  }
  set_points(detection, points);
  if ((target.columns + target.rows) % 2 == 0) {
    detection.warnings.push_back(
        {Kind::half_turn,
         "the board looks the same after half a turn: the end that is uppermost was taken for its "
         "upper left. Cameras that see it from different sides need an odd and an even count"});
  }
}

}  // namespace semblance
