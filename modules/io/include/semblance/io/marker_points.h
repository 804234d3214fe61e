// Files of dots on an object (docs/formats/marker-points.md).
#pragma once

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

namespace semblance {

/// A round dot on an object, in the object's frame.
struct MarkerPoint {
  std::string name;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  std::optional<double> radius_m{};
  std::optional<Eigen::Vector3d> normal{};  // out of the object, of length 1
  /// Deviation along x, y and z; absent where it is not known.
  std::optional<Eigen::Vector3d> sigma_m{};
};

/// Points from the JSON of a file. Throws InvalidInput naming `source` and the key: at most 10,000
/// points with names that differ, none empty, finite figures.
std::vector<MarkerPoint> marker_points_from_json(const nlohmann::json& json,
                                                 const std::string& source);
std::vector<MarkerPoint> read_marker_points(const std::string& path);
void write_marker_points(const std::string& path, const std::vector<MarkerPoint>& points);

}  // namespace semblance
