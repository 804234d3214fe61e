#include "semblance/cameras/survey.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "reprojection.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

void check(bool ok, const std::string& source, const std::string& problem) {
  if (!ok) throw InvalidInput(source + ": " + problem);
}

bool within(int index, std::size_t size) {
  return index >= 0 && static_cast<std::size_t>(index) < size;
}

}  // namespace

Eigen::Vector3d warped_point(const Survey& survey, int point) {
  Eigen::Vector3d result = survey.points_m[static_cast<std::size_t>(point)];
  if (!survey.warp_m.isZero(0.0)) {
    result.z() += warp_shape(result, points_box(survey)).dot(survey.warp_m);
  }
  return result;
}

Eigen::Vector2d residual_px(const Survey& survey, const Sighting& sighting) {
  const auto at = static_cast<std::size_t>(sighting.camera);
  const Camera& camera = survey.cameras[at];
  const Eigen::Vector3d point_camera_m =
      camera.camera_from_world *
      (survey.world_from_target[static_cast<std::size_t>(sighting.placement)] *
       warped_point(survey, sighting.point));
  if (!(point_camera_m.z() > 0.0)) {
    return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  }
  const double offset_s = survey.time_offset_s.empty() ? 0.0 : survey.time_offset_s[at];
  return project(camera, point_camera_m) + offset_s * sighting.velocity_px_s - sighting.pixel_px;
}

void validate(const Survey& survey, const std::string& source) {
  for (const Camera& camera : survey.cameras) validate(camera, source);
  for (std::size_t i = 0; i < survey.world_from_target.size(); ++i) {
    const Rigid3& pose = survey.world_from_target[i];
    check(pose.rotation.coeffs().allFinite() && pose.translation_m.allFinite(), source,
          fmt::format("placement {} is not finite", i));
  }
  for (std::size_t i = 0; i < survey.points_m.size(); ++i) {
    check(survey.points_m[i].allFinite(), source, fmt::format("point {} is not finite", i));
  }
  for (const Sighting& sighting : survey.sightings) {
    check(within(sighting.camera, survey.cameras.size()) &&
              within(sighting.placement, survey.world_from_target.size()) &&
              within(sighting.point, survey.points_m.size()),
          source,
          fmt::format("a sighting names camera {}, placement {}, point {}, but there are {}, {} "
                      "and {}",
                      sighting.camera, sighting.placement, sighting.point, survey.cameras.size(),
                      survey.world_from_target.size(), survey.points_m.size()));
    check(sighting.pixel_px.allFinite() && sighting.velocity_px_s.allFinite() &&
              std::isfinite(sighting.spread) && sighting.spread > 0.0,
          source,
          fmt::format("the sighting of point {} by camera {} or its spread is no figure",
                      sighting.point, sighting.camera));
  }
  check(survey.time_offset_s.empty() || survey.time_offset_s.size() == survey.cameras.size(),
        source, "there must be one time offset per camera, or none");
}

}  // namespace semblance
