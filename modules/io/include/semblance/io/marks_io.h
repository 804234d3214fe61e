// Files of marks in photos, semblance.marks/1 (docs/formats/marks.md).
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace semblance {

/// Points that carry names, and where photos show them. Pixels are ours: the first one's centre is
/// (0.5, 0.5).
struct MarksFile {
  struct Photo {
    std::string file;  // as found from here: relative names start at the marks file's folder
    std::map<std::string, Eigen::Vector2d> marks_px;
    std::string camera = {};  // its name; empty: that of the file, without its ending
  };
  struct Length {
    std::string from, to;
    double length_m = 0.0, sigma_m = 0.0;
  };
  /// A frame for the result: `origin` at zero, `x` on the positive x axis, `y` in the xy plane with
  /// y > 0.
  struct Axes {
    std::string origin, x, y;
  };

  std::vector<Photo> photos;
  std::map<std::string, Eigen::Vector3d> points_m;  // where they are known, roughly or exactly
  /// Deviation of each coordinate of those points, which then are the frame; none: only roughly.
  std::optional<double> points_sigma_m;
  std::vector<Length> lengths;
  std::optional<Axes> axes;

  /// All names that photos or points have, in order.
  std::vector<std::string> names() const;
};

/// Throws InvalidInput that lists every problem with file and key: figures that are not finite,
/// lengths and axes of names that are nowhere, a photo listed twice, two frames.
MarksFile read_marks(const std::string& path);
void write_marks(const std::string& path, const MarksFile& marks);

}  // namespace semblance
