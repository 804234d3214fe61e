#include "semblance/geometry/marker_path.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

void require_blend(const char* name, double value) {
  if (!std::isfinite(value) || !(value > -1.0)) {
    throw InvalidInput(std::string("blending parameter ") + name + " = " + std::to_string(value) +
                       " must be a number above -1; 0 blends evenly");
  }
}

void require_scaling(const char* component, const char* place_name, double place,
                     const char* height_name, double height) {
  if (!(place > 0.0 && place < 1.0)) {
    throw InvalidInput(std::string(component) + " " + place_name + " = " + std::to_string(place) +
                       " must lie strictly between 0 and 1; 0.5 is the middle");
  }
  if (!std::isfinite(height)) {
    throw InvalidInput(std::string(component) + " " + height_name +
                       " must be finite; 1 is the parabola");
  }
}

void require_path(const char* component, const char* blend, const PathControls& controls) {
  require_blend(blend, controls.n);
  require_scaling(component, "alpha", controls.alpha, "beta", controls.beta);
  require_scaling(component, "gamma", controls.gamma, "delta", controls.delta);
}

void require_key(const MarkerKey& key) {
  if (!std::isfinite(key.time_s) || !key.position.allFinite() || !key.velocity.allFinite() ||
      !std::isfinite(key.depth)) {
    throw InvalidInput(
        "marker path: a key frame's time, position, velocity and depth must be "
        "finite");
  }
}

/// ScalingShape measures heights by the parabola's own value at alpha, the report by its top.
ScalingShape shape_through(double place, double height) {
  return {place, height / (4.0 * place * (1.0 - place))};
}

HomotopyPath homotopy(double start, double end, double start_slope, double end_slope,
                      const PathControls& controls) {
  // HomotopyPath mirrors its second shape, which is measured from the end.
  return {start,
          end,
          start_slope,
          end_slope,
          controls.n,
          shape_through(controls.alpha, controls.beta),
          shape_through(1.0 - controls.gamma, controls.delta)};
}

}  // namespace

void validate(const MarkerControls& controls) {
  require_path("radial", "n", controls.radial);
  require_path("tangential", "m", controls.tangential);
  require_blend("p", controls.depth_blend);
}

MarkerPath::MarkerPath(const MarkerKey& first, const MarkerKey& second,
                       const Eigen::Vector2d& reference, const MarkerControls& controls)
    : start_s_(first.time_s),
      duration_s_(second.time_s - first.time_s),
      reference_(reference),
      first_depth_(first.depth),
      depth_change_(second.depth - first.depth),
      depth_blend_(controls.depth_blend) {
  validate(controls);
  require_key(first);
  require_key(second);
  if (!reference.allFinite()) throw InvalidInput("marker path: the reference point is not finite");
  if (!(duration_s_ > 0.0)) {
    throw InvalidInput("marker path: the key frames at " + std::to_string(first.time_s) +
                       " s and " + std::to_string(second.time_s) +
                       " s are not in order of time; give different times, the earlier first");
  }
  const Eigen::Vector2d from_reference = first.position - reference;
  const double radius = from_reference.norm();
  if (!(radius > 1e-9 * (1.0 + reference.norm()))) {
    throw InvalidInput("marker path: the marker lies on the reference point (" +
                       std::to_string(reference.x()) + ", " + std::to_string(reference.y()) +
                       ") and has no direction from there; choose another reference point");
  }
  radial_axis_ = from_reference / radius;
  tangential_axis_ = {-radial_axis_.y(), radial_axis_.x()};
  const Eigen::Vector2d end = second.position - reference;
  const Eigen::Vector2d v1 = first.velocity * duration_s_, v2 = second.velocity * duration_s_;
  radial_ = homotopy(radius, radial_axis_.dot(end), radial_axis_.dot(v1), radial_axis_.dot(v2),
                     controls.radial);
  tangential_ = homotopy(0.0, tangential_axis_.dot(end), tangential_axis_.dot(v1),
                         tangential_axis_.dot(v2), controls.tangential);
}

PathPoint MarkerPath::at(double time_s) const {
  const double v = std::clamp((time_s - start_s_) / duration_s_, 0.0, 1.0);
  const ValueSlope r = radial_.at(v), w = tangential_.at(v), blend = blend_flat(v, depth_blend_);
  PathPoint state;
  state.position.head<2>() = reference_ + r.value * radial_axis_ + w.value * tangential_axis_;
  state.velocity.head<2>() = (r.slope * radial_axis_ + w.slope * tangential_axis_) / duration_s_;
  state.position.z() = first_depth_ + blend.value * depth_change_;
  state.velocity.z() = blend.slope * depth_change_ / duration_s_;
  return state;
}

}  // namespace semblance
