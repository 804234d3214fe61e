// Dots painted on the lips of a head.
#pragma once

#include <array>
#include <vector>

#include "face_colour.h"
#include "semblance/core/mesh.h"
#include "semblance/synth/clip_spec.h"

namespace semblance {

/// Round dots on the skin of the neutral model, in the order of io/lip_markers.h. The inner ones
/// lie a third of the lip's thickness from where the lips meet, so that a closed mouth shows them,
/// or right beside the corners; each outer one lies on the border of the lips or outside of it, two
/// diameters or more from its inner neighbour.
class LipPaint {
 public:
  /// A dot's centre: a place inside a triangle of the skin.
  struct Dot {
    std::array<int, 3> corners{};  // vertices of `skin`
    Eigen::Vector3f weights = Eigen::Vector3f::Zero();
    Eigen::Vector3f centre_m = Eigen::Vector3f::Zero();  // neutral model
  };

  LipPaint() = default;  // no dots
  /// Throws InvalidInput if the skin has no surface where a dot should be.
  LipPaint(const MarkerSpec& spec, const NeutralLandmarks& landmarks, const Mesh& skin);

  const std::vector<Dot>& dots() const { return dots_; }
  /// The colour at a place of the neutral skin, with paint where there is a dot.
  Eigen::Vector3f over(const Eigen::Vector3f& place_m, const Eigen::Vector3f& bare) const;

 private:
  std::vector<Dot> dots_;
  float radius_m_ = 0.0f;
  Eigen::Vector3f colour_ = Eigen::Vector3f::Zero();
};

}  // namespace semblance
