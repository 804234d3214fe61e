// Calibration sheets: how they are named, and where their points are.
//
// The sheet's frame has x to the right and y down as printed, z = 0 on the sheet and z away from
// the reader, so that a camera in front of the sheet sees it unmirrored. Sizes are metres.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace semblance {

enum class TargetKind { automatic, chessboard, charuco, aprilgrid, circles, dots };

/// A sheet. `columns`, `rows` and `size_m` mean:
///
///   kind        text                                              counted        size_m
///   chessboard  chessboard:9x6:0.025                              inner corners  side of a square
///   charuco     charuco:4x5:0.054:DICT_4X4_1000[:MARKER][:legacy] squares        side of a square
///   aprilgrid   aprilgrid:6x6:0.088:0.3[:border2][:first36]       tags           side of a tag
///   circles     circles:4x11:0.02[:asymmetric]                    circles        step (below)
///   dots        dots:13x9:0.02                                    dots           step
///   automatic   auto[:SIZE]                                       found          as the kind found
///
/// Chessboard: a black square is in the upper left corner. The origin is point 0. Where columns and
/// rows are both even or both odd, half a turn leaves the sheet as it is; no chessboard differs
/// from one that is mirrored.
///
/// ChArUco: OpenCV's board (4.6 and later, and with `legacy` the older layout, which differs where
/// rows are even). MARKER is the side of a marker, 0.75 squares where it is not given. White on
/// black is recognised. The points are the inner corners; the origin is the pattern's upper left
/// corner.
///
/// AprilGrid: Kalibr's sheet of tag36h11: side of a tag with its black border, the gap in parts of
/// that side, a border of `border2` bits instead of 1, the first tag's id (0). Tag ids grow to the
/// right and upwards from the lower left. The origin is the upper left corner of the upper left
/// tag.
///
/// Circles: OpenCV's grids. Symmetric: the step is the distance of neighbours (half a turn leaves
/// the sheet as it is). Asymmetric: circle (i, j) is at x = (2 i + j mod 2) steps, y = j steps. The
/// origin is point 0.
///
/// Dots: a regular grid whose dots are half a step wide but for three of 0.75 steps: one just left
/// of the middle, one two steps to its right and one a step below it (`large_dots`). They name
/// every dot of a sheet that is seen in part.
struct Target {
  TargetKind kind = TargetKind::automatic;
  int columns = 0, rows = 0;
  double size_m = 0.0;      // automatic: 0 where it is not known
  double marker_m = 0.0;    // charuco
  double gap_ratio = 0.0;   // aprilgrid
  std::string dictionary;   // charuco: OpenCV's name
  int border_bits = 1;      // aprilgrid
  int first_id = 0;         // aprilgrid
  bool asymmetric = false;  // circles
  bool legacy = false;      // charuco

  bool operator==(const Target&) const = default;
};

/// Reads the text of a sheet. Throws InvalidInput with the known forms where it is none of them.
Target parse_target(const std::string& text);
/// The text that `parse_target` reads as this sheet.
std::string target_text(const Target& target);

/// Ids of the sheet's points, ascending. Chessboards, circles and dots: column + columns * row.
/// ChArUco: the same for inner corners. AprilGrid: 4 * tag id + corner, corners in the order of
/// libapriltag: lower left, lower right, upper right, upper left.
std::vector<int> point_ids(const Target& target);
/// Where a point is on the sheet. Throws InvalidInput for an id that the sheet does not have.
Eigen::Vector3d point_on_sheet(const Target& target, int id);
/// The point in words, as in "tag 12, upper left" or "column 3, row 0".
std::string point_name(const Target& target, int id);

/// The three larger dots of a dot sheet as (column, row): the middle one, its right, the one below.
std::vector<Eigen::Vector2i> large_dots(const Target& target);
/// Diameters of a dot sheet's dots in steps; circles have the smaller one.
inline constexpr double small_dot_steps = 0.5;
inline constexpr double large_dot_steps = 0.75;

}  // namespace semblance
