#include "sheet_circles.h"

#include <algorithm>

#include "marker_views.h"

namespace semblance {
namespace {

/// Faces of the sheet's circles: upright on it, the radius by what all views measure.
std::vector<std::optional<DotFace>> faces_on_sheet(const Adjustment& found,
                                                   const std::vector<double>& radius_px) {
  constexpr double unit_m = 1e-3;
  const Survey& survey = found.survey;
  std::vector<std::vector<double>> radii_m(survey.points_m.size());
  for (std::size_t i = 0; i < survey.sightings.size(); ++i) {
    if (found.outlier[i]) continue;
    const Sighting& sighting = survey.sightings[i];
    const Camera& camera = survey.cameras[static_cast<std::size_t>(sighting.camera)];
    const Rigid3 camera_from_sheet =
        camera.camera_from_world *
        survey.world_from_target[static_cast<std::size_t>(sighting.placement)];
    const Disc disc{camera_from_sheet * survey.points_m[static_cast<std::size_t>(sighting.point)],
                    camera_from_sheet.rotation * Eigen::Vector3d::UnitZ(), unit_m};
    if (disc.centre_m.z() < 2.0 * unit_m) continue;
    radii_m[static_cast<std::size_t>(sighting.point)].push_back(unit_m * radius_px[i] /
                                                                image_of(camera, disc).radius_px);
  }
  std::vector<std::optional<DotFace>> faces(radii_m.size());
  for (std::size_t k = 0; k < faces.size(); ++k) {
    if (radii_m[k].empty()) continue;
    const auto middle = radii_m[k].begin() + static_cast<std::ptrdiff_t>(radii_m[k].size() / 2);
    std::nth_element(radii_m[k].begin(), middle, radii_m[k].end());
    faces[k] = DotFace{Eigen::Vector3d::UnitZ(), *middle};
  }
  return faces;
}

}  // namespace

Adjustment with_circles_corrected(Adjustment found, const std::vector<double>& radius_px) {
  if (radius_px.empty()) return found;
  constexpr int rounds = 2;
  std::vector<Eigen::Vector2d> measured_px;
  for (const Sighting& sighting : found.survey.sightings) measured_px.push_back(sighting.pixel_px);
  for (int round = 0; round < rounds; ++round) {
    Survey survey = found.survey;
    correct_for_perspective(survey, measured_px, faces_on_sheet(found, radius_px));
    Adjustment next = adjust(survey, found.options);
    next.solve_s += found.solve_s;
    next.iterations += found.iterations;
    found = std::move(next);
  }
  return found;
}

}  // namespace semblance
