// The procedural colours of a head: a solid function of the place on the neutral model.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "semblance/core/random.h"

namespace semblance {

/// The 68 landmarks (iBUG order) of the neutral model, metres, model frame.
using NeutralLandmarks = std::array<Eigen::Vector3f, 68>;

/// The drawn looks of one person.
struct PersonLook {
  std::uint32_t noise_seed = 1;
  float skin_tone = 0.5f;        // 0 dark to 1 light
  float redness = 0.0f;          // -1 to 1, flush of cheeks, nose, ears
  float freckles = 0.0f;         // 0 to 1
  float stubble = 0.0f;          // 0 to 1
  float lip_strength = 0.7f;     // how much the lips' colour differs from the skin
  float brow_thickness = 1.0f;   // relative
  float hair_height_m = 0.012f;  // thickness of the hair
  float hairline_m = 0.055f;     // height of the hairline above the brows
  Eigen::Vector3f hair = Eigen::Vector3f::Zero();  // linear RGB
  Eigen::Vector3f iris = Eigen::Vector3f::Zero();
  Eigen::Vector3f cloth = Eigen::Vector3f::Zero();
};

/// Draws a person; `skin_tone` and `stubble` are taken as given where not negative.
PersonLook draw_person(Random& random, double skin_tone, double stubble);

/// Mean albedo (linear RGB) of skin of the given tone: the line in log reflectance through the
/// patches "dark skin" and "light skin" of the ColorChecker (McCamy, Marcus and Davidson 1976; sRGB
/// 115 82 68 and 194 150 130), with 0.1 of its length beyond either end.
Eigen::Vector3f skin_albedo(float tone);

/// Colour of skin, lips, brows, lash line, stubble and hair at a place of the neutral model.
class FaceColour {
 public:
  FaceColour(const PersonLook& look, const NeutralLandmarks& landmarks, float crown_y_m);

  Eigen::Vector3f skin(const Eigen::Vector3f& place_m) const;
  /// 1 in the hair of the scalp, 0 on bare skin, without strands.
  float hair_cover(const Eigen::Vector3f& place_m) const;
  /// Colour of an eye's surface at `offset_m` (right, up) from the axis of the eye.
  Eigen::Vector3f eye(const Eigen::Vector2f& offset_m, float iris_radius_m) const;
  /// Signed distance to the outer border of the lips seen from the front, negative inside, metres.
  float lip_distance(const Eigen::Vector3f& place_m) const;

 private:
  using Curve = std::vector<Eigen::Vector2f>;
  void apply_zones(const Eigen::Vector3f& place_m, Eigen::Vector3f& colour) const;
  void apply_spots(const Eigen::Vector3f& place_m, Eigen::Vector3f& colour) const;
  void apply_lips(const Eigen::Vector3f& place_m, Eigen::Vector3f& colour) const;
  void apply_stubble(const Eigen::Vector3f& place_m, Eigen::Vector3f& colour) const;
  void apply_eye_rims(const Eigen::Vector3f& place_m, Eigen::Vector3f& colour) const;
  void apply_brows(const Eigen::Vector3f& place_m, Eigen::Vector3f& colour) const;
  void apply_hair(const Eigen::Vector3f& place_m, Eigen::Vector3f& colour) const;
  bool in_front(const Eigen::Vector3f& place_m) const;

  PersonLook look_;
  NeutralLandmarks landmarks_;
  Eigen::Vector3f base_;
  Curve lips_, lip_line_;
  std::array<Curve, 2> brows_, upper_lids_, lower_lids_;
  float brow_y_ = 0, crown_y_ = 0, axis_z_ = 0;
};

}  // namespace semblance
