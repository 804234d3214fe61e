// The built-in face as a surface: every vertex is a place on a swept patch, and the sweep gives its
// position for any identity. Millimetres, in the face's own frame, inside these files.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "face_identity.h"
#include "semblance/core/mesh.h"
#include "semblance/models/morph_model.h"

namespace semblance::face {

/// Feature lines of the head, from the vertex down. A row coordinate counts along them: 4.5 is
/// halfway between lid_crease and upper_lid.
inline constexpr int line_vertex = 0;
inline constexpr int line_trichion = 1;
inline constexpr int line_brow_top = 2;
inline constexpr int line_brow_low = 3;
inline constexpr int line_lid_crease = 4;
inline constexpr int line_upper_lid = 5;
inline constexpr int line_lower_lid = 6;
inline constexpr int line_cheek_top = 7;
inline constexpr int line_nose_mid = 8;
inline constexpr int line_ala_top = 9;
inline constexpr int line_tip_low = 10;
inline constexpr int line_subnasale = 11;
inline constexpr int line_upper_vermilion = 12;
inline constexpr int line_upper_contact = 13;
inline constexpr int line_lower_contact = 14;
inline constexpr int line_lower_vermilion = 15;
inline constexpr int line_mentolabial = 16;
inline constexpr int line_pogonion = 17;
inline constexpr int line_jaw = 18;
inline constexpr int line_neck = 19;
inline constexpr int line_bottom = 20;
inline constexpr int line_count = 21;

/// Feature columns of one half, from the face's middle to the back of the head.
inline constexpr int column_middle = 0;
inline constexpr int column_philtrum = 1;
inline constexpr int column_nostril = 2;
inline constexpr int column_inner_eye = 3;
inline constexpr int column_mouth_corner = 4;
inline constexpr int column_pupil = 5;
inline constexpr int column_outer_eye = 6;
inline constexpr int column_cheek = 7;
inline constexpr int column_zygion = 8;
inline constexpr int column_ear = 9;
inline constexpr int column_behind_ear = 10;
inline constexpr int column_occiput = 11;
inline constexpr int column_back = 12;
inline constexpr int column_count = 13;

enum class Patch : std::uint8_t {
  skin,
  upper_lid_inside,  // `depth` 1 margin's inner edge, 2 behind the eyeball's surface
  lower_lid_inside,
  upper_lip_inside,  // `depth` 1..4 from the lip to the throat
  lower_lip_inside,
  eyeball,      // `a` angle from the optical axis, `b` angle around it
  upper_teeth,  // `a` along the arch in [-1, 1], `b` station around the section
  lower_teeth,
  ear  // `a` ring 0 (attached) .. 1 (concha), `b` angle around
};

/// Where a vertex lies on the swept patches.
struct Place {
  Patch patch = Patch::skin;
  double side = 1.0;        // +1 left half, -1 right half, 0 the middle
  double column = 0.0;      // skin and linings: column coordinate
  double row = 0.0;         // skin: row coordinate
  int depth = 0;            // linings
  double a = 0.0, b = 0.0;  // other patches
};

using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// Vertices, triangles and charts of the face at one density.
struct Layout {
  std::vector<Place> places;
  std::vector<Eigen::Vector3i> triangles;
  std::vector<Eigen::Vector2f> uvs;
  std::vector<std::uint8_t> part;
};
Layout make_layout(double density);

/// The swept surface at fixed places, for any identity.
class Sweep {
 public:
  explicit Sweep(std::vector<Place> places);
  /// Positions of the places in millimetres.
  Points at(const Identity& identity) const;

 private:
  std::vector<Place> places_;
  std::vector<Eigen::Vector3d> contours_;  // left half, as the contours have it
};
/// The same for places that are asked for once.
Points sweep(const std::vector<Place>& places, const Identity& identity);

/// Centre of the left eyeball and its radius, and the lids' shell outside it.
inline const Eigen::Vector3d ear_root(68.5, -18.0, -80.0);
inline constexpr double eye_x_mm = 31.65, eye_radius_mm = 12.0, iris_radius_mm = 5.85;

}  // namespace semblance::face
