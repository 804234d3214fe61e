// Cameras from round dots on any object, whose places are known or not.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "semblance/cameras/adjustment.h"
#include "semblance/cameras/dots.h"
#include "semblance/io/marker_points.h"

namespace semblance {

/// One camera's picture of the object at one instant. The object stands still for an instant.
struct MarkerPicture {
  int camera = 0, instant = 0;
  std::string name;
  int width = 0, height = 0;
  std::vector<Dot> dots;
  bool follows = false;  // shortly after the picture before it in the list, as in a video
};

/// The distance of two dots, by name, as measured by hand.
struct MarkerLength {
  std::string a, b;
  double length_m = 0.0;
};

struct MarkerOptions {
  Lens lens = Lens::pinhole;
  bool aspect = false;     // otherwise pixels are square
  bool principal = false;  // otherwise the middle of the picture
  bool keep_outliers = false;
  /// Focal length within a factor of 1.3 or so; otherwise those of usual lenses are tried.
  std::optional<double> rough_focal_px;
  std::optional<MarkerLength> length;  // for unknown places; without it the scale is arbitrary
  std::function<bool()> cancelled;
};

struct MarkerCalibration {
  Adjustment adjustment;            // points are those of `points`, in their order
  std::vector<MarkerPoint> points;  // with deviations where they were sought
  std::vector<int> picture_of_sighting, dot_of_sighting;
  std::vector<std::string> notes;  // pictures that could not be used, and why
};

/// Cameras from dots at known places. Dots carry no names: each picture's are found by where they
/// are (DotNamer), from the picture before where one follows another, otherwise from nothing. With
/// several cameras the first one is the frame, and the others are chained to it through instants
/// that pairs of them share.
///
/// Centres are corrected for perspective, by radii and normals as given, otherwise as the ellipses
/// say where several views agree.
///
/// Throws InvalidInput for points that a turn leaves the same (no picture can name them) or that
/// are too few, for pictures of one camera that differ in size, and for cameras that share no
/// instant; SolverError, saying what is missing, where no picture's dots can be named beyond doubt.
MarkerCalibration calibrate_known_markers(const std::vector<MarkerPicture>& pictures,
                                          const std::vector<std::string>& camera_names,
                                          const std::vector<MarkerPoint>& points,
                                          const MarkerOptions& options);

/// One camera and the dots' places, from a video or pictures in order in which dots can be followed
/// (follow_dots). The start is the essential matrix of two pictures (Nister, "An efficient solution
/// to the five-point relative pose problem", PAMI 26, 2004), tried for a row of focal lengths and
/// pairs; further pictures and dots are added in turn; all is adjusted together. Dots are named
/// d01, d02, ... in the order in which they are seen, from the top down. Dots that return are
/// recognised.
///
/// The first picture used is the object's frame: x right, y down, z forward. Radii and normals of
/// dots are estimated from their ellipses, and centres corrected for perspective.
///
/// Throws InvalidInput for several cameras, pictures that differ in size, and a length between dots
/// that are not there; SolverError where dots cannot be followed, or do not move as a body.
MarkerCalibration calibrate_unknown_markers(const std::vector<MarkerPicture>& pictures,
                                            const std::string& camera_name,
                                            const MarkerOptions& options);

}  // namespace semblance
