// One detector for each kind of sheet, on 8-bit grey pictures. Places here have the first pixel's
// centre at (0, 0), as in OpenCV; `to_ours` ends that.
#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "lattice.h"
#include "saddles.h"
#include "semblance/cameras/detect.h"
#include "semblance/cameras/tag_detector.h"

namespace semblance {

/// Points by id, in OpenCV's convention.
using PointsById = std::map<int, Eigen::Vector2d>;

/// Ids and points of a detection from what a detector found.
void set_points(Detection& detection, const PointsById& points);

inline Eigen::Vector2d vector_of(cv::Point2f p) { return {p.x, p.y}; }
inline cv::Point2f point_of(const Eigen::Vector2d& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y())};
}

/// Lattice coordinates turned by quarters so that the lowest column and row are 0.
Lattice turned(const Lattice& lattice, int quarters);

// Chessboards.
struct ChessLattice {
  std::vector<Eigen::Vector2d> points_px;
  std::vector<SaddleLook> looks;
  Lattice lattice;

  bool complete() const;
};
/// The largest chessboard seen, at the picture's full resolution; empty where there is none.
/// The search ends early at a complete one of `columns` x `rows` inner corners (0: any).
ChessLattice find_chess_lattice(const cv::Mat& grey, int columns, int rows);
void detect_chessboard(const cv::Mat& grey, Detection& detection);

// Sheets of markers that have names.
struct NamedQuad {
  int id = 0;
  std::array<Eigen::Vector2d, 4> corners_px;  // in the order of the sheet's layout
};
std::vector<NamedQuad> find_aruco(const cv::Mat& grey, const std::string& dictionary,
                                  bool& inverted);
std::vector<NamedQuad> find_tags(const cv::Mat& grey, TagDetector& detector);
/// `quads` are those of `find_aruco`, `inverted` says that they are white on black.
void detect_charuco(const cv::Mat& grey, const std::vector<NamedQuad>& quads, Detection& detection);
void detect_aprilgrid(const cv::Mat& grey, const std::vector<NamedQuad>& quads,
                      Detection& detection);

// Sheets of round dots.
struct DotLattice {
  std::vector<Eigen::Vector2d> centres_px;
  std::vector<double> radii_px;  // of the circle of equal area
  Lattice lattice;
};
DotLattice find_dot_lattice(const cv::Mat& grey);
void detect_circles(const DotLattice& dots, Detection& detection);
void detect_dots(const DotLattice& dots, Detection& detection);
/// The cells of an asymmetric grid in the lattice of its neighbours, which runs along diagonals.
Cell asymmetric_cell(int column, int row);

}  // namespace semblance
