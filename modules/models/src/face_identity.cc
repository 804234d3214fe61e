#include "face_identity.h"

#include <algorithm>
#include <cmath>

#include "face_profile.h"
#include "face_skin.h"
#include "face_sweep.h"

namespace semblance::face {
namespace {

using Eigen::Vector3d;
using Kind = MeasureKind;

constexpr SkinPoint nasion{0, line_lid_crease - 0.15}, glabella{0, line_brow_top + 0.4};
constexpr SkinPoint subnasale{0, line_subnasale}, pronasale{0, line_ala_top + 0.15};
constexpr SkinPoint stomion{0, line_upper_contact}, gnathion{0, line_jaw};
constexpr SkinPoint labiale_superius{0, line_upper_vermilion};
constexpr SkinPoint labiale_inferius{0, line_lower_vermilion};

enum Parameter {
  head_length,
  head_breadth,
  head_height,
  forehead_height,
  forehead_breadth,
  face_height,
  face_breadth,
  upper_face_depth,
  middle_face_depth,
  lower_face_depth,
  mandible_width,
  chin_width,
  chin_protrusion,
  cheekbone_prominence,
  cheek_fullness,
  interpupillary_distance,
  eye_fissure_length,
  eye_fissure_height,
  eye_fissure_slant,
  eye_depth,
  brow_height,
  brow_ridge,
  nose_length,
  nose_breadth,
  nose_protrusion,
  nasal_bridge_height,
  nasal_bridge_width,
  nose_tip_height,
  upper_lip_height,
  mouth_width,
  upper_vermilion_height,
  lower_vermilion_height,
  lip_protrusion,
  ear_length,
  ear_protrusion,
  neck_width
};

// The eyes' surroundings move with them as one piece.
double around_eye(double x, double y) {
  return smooth_step(x, 3, 15) * (1.0 - smooth_step(x, 48, 64)) * smooth_step(y, -34, -15) *
         (1.0 - smooth_step(y, 14, 32));
}

// How far a place follows the lids' rotations: 1 at the margins, 0 at crease and cheek.
double upper_lid_share(const Place& place) {
  if (place.patch == Patch::upper_lid_inside) return 1.0;
  if (place.patch != Patch::skin) return 0.0;
  return place.row <= line_upper_lid ? smooth_step(place.row, line_lid_crease - 0.2, line_upper_lid)
                                     : 0.0;
}
double lower_lid_share(const Place& place) {
  if (place.patch == Patch::lower_lid_inside) return 1.0;
  if (place.patch != Patch::skin) return 0.0;
  return place.row >= line_lower_lid
             ? 1.0 - smooth_step(place.row, line_lower_lid, line_cheek_top + 0.2)
             : 0.0;
}

Vector3d eye_motion(const Place& place, const Vector3d& p, const Identity& c) {
  const Vector3d q = p - Vector3d(eye_x_mm, 0, 0);
  Vector3d d = Vector3d::Zero();
  // The outer corner moves sideways; over the eyeball the lid slides along it.
  const double outwards = c[eye_fissure_length] * bump2(p.x(), p.y(), 46.0, 0, 6.0, 10);
  const double slide =
      (1.0 - smooth_step(q.x(), 10, 13)) * std::min(1.0, q.x() / std::max(6.0, q.z()));
  d += Vector3d(outwards, 0.0, -outwards * slide);
  // Rotations about the eye's centre keep the lids' distance from the eyeball.
  const double slit = slit_share(p.x() - eye_x_mm);
  const double pitch = c[eye_fissure_height] * slit *
                       (0.6 * upper_lid_share(place) - 0.4 * lower_lid_share(place)) /
                       eye_radius_mm;
  d += Vector3d(0.0, q.z() * std::sin(pitch) + q.y() * (std::cos(pitch) - 1.0),
                -q.y() * std::sin(pitch) + q.z() * (std::cos(pitch) - 1.0));
  const double ring = bump(q.head<2>().norm(), 0.0, 20.0);
  const double roll = c[eye_fissure_slant] * ring / 15.0;
  d += Vector3d(-q.y() * roll, q.x() * roll, 0.0);
  return d;
}

// The face forwards from the ears, in thirds that leave no step between them. A parameter is the
// motion at the front; behind the ears and on the crown nothing moves.
Vector3d depth_motion(const Vector3d& p, const Identity& c) {
  constexpr double ear_z = -75.0, front_z = 20.0;
  const double upper = smooth_step(p.y(), -35, 10), lower = 1.0 - smooth_step(p.y(), -100, -50);
  const double forwards = upper * c[upper_face_depth] + lower * c[lower_face_depth] +
                          (1.0 - upper - lower) * c[middle_face_depth];
  const double share = std::max(0.0, p.z() - ear_z) / (front_z - ear_z);
  return {0.0, 0.0, forwards * share * (1.0 - smooth_step(p.y(), 60, 130))};
}

Vector3d head_motion(const Vector3d& p, const Identity& c) {
  const double x = p.x(), y = p.y(), z = p.z();
  Vector3d d = Vector3d::Zero();
  d.z() -= c[head_length] * std::max(0.0, -70.0 - z) / 101.0 * smooth_step(y, -110, -40);
  d.x() += c[head_breadth] * 0.5 * x / 75.0 * smooth_step(y, -25, 40);
  d.y() += c[head_height] * std::max(0.0, y - 12.0) / 108.0;
  d.y() += c[forehead_height] * smooth_step(y, 25, 74) * (1.0 - smooth_step(y, 74, 118)) *
           smooth_step(z, -80, -20);
  d.x() += c[forehead_breadth] * 0.5 * smooth_step(x, 10, 56) * bump(y, 32, 26) *
           smooth_step(z, -75, -30);
  d.x() += c[face_breadth] * 0.5 * x / 68.0 * bump(y, -22, 45) * smooth_step(z, -125, -65);
  d.x() += c[mandible_width] * 0.5 * smooth_step(x, 12, 52) * bump(y, -80, 30) *
           smooth_step(z, -110, -60);
  d.x() +=
      c[neck_width] * 0.5 * x / 57.0 * smooth_step(-y, 78, 125) * (1.0 - smooth_step(z, -45, -5));
  return d;
}

Vector3d profile_motion(const Vector3d& p, const Identity& c) {
  const double x = p.x(), y = p.y();
  const double middle = (1.0 - smooth_step(x, 34, 66)) * smooth_step(p.z(), -60, -15);
  Vector3d d = Vector3d::Zero();
  d.y() -= c[face_height] * ramp(-y, 6, 113);
  d.y() -= c[nose_length] * middle * ramp(-y, -4, 46.5) * (1.0 - ramp(-y, 46.5, 113));
  d.y() -= c[upper_lip_height] * middle * ramp(-y, 47, 66) * (1.0 - ramp(-y, 68, 113));
  d.y() += c[upper_vermilion_height] * (1.0 - smooth_step(x, 14, 27)) * smooth_step(y, -67, -60) *
           (1.0 - smooth_step(y, -59, -48));
  d.y() -= c[lower_vermilion_height] * (1.0 - smooth_step(x, 14, 27)) * smooth_step(-y, 67, 75) *
           (1.0 - smooth_step(-y, 76, 86));
  d.x() +=
      c[mouth_width] * 0.5 * ramp(x, 0, 26) * (1.0 - smooth_step(x, 27, 58)) * bump(y, -67, 18);
  d.z() += c[lip_protrusion] * bump2(x, y, 0, -67, 24, 13);
  d.x() += c[chin_width] * 0.5 * smooth_step(x, 3, 24) * (1.0 - smooth_step(x, 28, 46)) *
           bump(y, -102, 16);
  d.z() += c[chin_protrusion] * bump2(x, y, 0, -103, 30, 17);
  const Vector3d cheek = Vector3d(0.6, 0.0, 0.8);
  d += c[cheekbone_prominence] * bump2(x, y, 45, -20, 17, 14) * cheek;
  d += c[cheek_fullness] * bump2(x, y, 46, -55, 17, 19) * cheek;
  d.y() += c[brow_height] * bump(y, 22, y > 22 ? 20 : 11) * smooth_step(x, -12, 12) *
           (1.0 - smooth_step(x, 44, 66));
  d.z() += c[brow_ridge] * bump2(x, y, 14, 19, 24, 8);
  d.x() += c[nose_breadth] * 0.5 * smooth_step(x, 1, 15) * (1.0 - smooth_step(x, 20, 34)) *
           bump(y, -36, 12);
  // It falls off quickly below the tip: the lip stays.
  d.z() += c[nose_protrusion] * bump2(x, y, 0, -34, 11, y > -34 ? 17 : 7);
  d.z() += c[nasal_bridge_height] * bump2(x, y, 0, 0, 9, 17);
  d.x() += c[nasal_bridge_width] * 0.5 * bump2(x, y, 9, -4, 7, 15);
  d.y() += c[nose_tip_height] * bump2(x, y, 0, -36, 13, 9);
  return d;
}

Vector3d ear_motion(const Vector3d& p, const Identity& c) {
  const Vector3d q = p - ear_root;
  return Vector3d(c[ear_protrusion] * smooth_step(-q.z(), -10, 25), c[ear_length] * q.y() / 62.0,
                  c[ear_length] * 0.6 * q.z() / 62.0);
}

}  // namespace

const std::vector<IdentityMeasure>& identity_measures() {
  static const std::vector<IdentityMeasure> table = {
      {"head_length",
       197,
       7.0,
       Kind::distance,
       glabella,
       {column_back, line_brow_low},
       "glabella to opisthocranion (g-op)"},
      {"head_breadth",
       151,
       6.0,
       Kind::breadth,
       {column_ear, line_brow_top - 0.3},
       {},
       "greatest breadth of the skull (eu-eu)"},
      {"head_height", 0, 6.5, Kind::none, {}, {}, "vertex over the eyes"},
      {"forehead_height",
       67,
       6.0,
       Kind::distance,
       {0, line_trichion},
       nasion,
       "trichion to nasion (tr-n)"},
      {"forehead_breadth", 0, 5.0, Kind::none, {}, {}, "breadth at the temples (ft-ft)"},
      {"face_height", 121, 6.8, Kind::distance, nasion, gnathion, "nasion to gnathion (n-gn)"},
      {"face_breadth",
       137,
       4.6,
       Kind::breadth,
       {column_zygion + 0.3, line_cheek_top + 0.6},
       {},
       "between the zygomatic arches (zy-zy)"},
      {"upper_face_depth", 0, 4.5, Kind::none, {}, {}, "ears to nasion (t-n)"},
      {"middle_face_depth", 0, 5.0, Kind::none, {}, {}, "ears to subnasale (t-sn)"},
      {"lower_face_depth", 0, 6.0, Kind::none, {}, {}, "ears to gnathion (t-gn)"},
      {"mandible_width",
       112,
       7.0,
       Kind::breadth,
       {column_zygion, line_jaw - 0.9},
       {},
       "between the jaw's angles, over the skin (go-go)"},
      {"chin_width", 0, 4.0, Kind::none, {}, {}, "breadth of the chin"},
      {"chin_protrusion", 0, 3.5, Kind::none, {}, {}, "pogonion forwards"},
      {"cheekbone_prominence", 0, 2.0, Kind::none, {}, {}, "cheekbones outwards"},
      {"cheek_fullness", 0, 3.0, Kind::none, {}, {}, "cheeks below the bone outwards"},
      {"interpupillary_distance", 63.3, 3.6, Kind::eyes, {}, {}, "between the eyeballs' centres"},
      {"eye_fissure_length",
       30.9,
       1.3,
       Kind::distance,
       {column_inner_eye, line_upper_lid},
       {column_outer_eye, line_upper_lid},
       "inner to outer corner of the eye (en-ex)"},
      {"eye_fissure_height",
       10.6,
       1.1,
       Kind::distance,
       {column_pupil - 0.5, line_upper_lid},
       {column_pupil - 0.5, line_lower_lid},
       "between the lids' margins (ps-pi)"},
      {"eye_fissure_slant", 0, 1.0, Kind::none, {}, {}, "outer corner of the eye upwards"},
      {"eye_depth", 0, 1.5, Kind::none, {}, {}, "eyes and lids backwards in the face"},
      {"brow_height", 0, 2.5, Kind::none, {}, {}, "eyebrow over the eye"},
      {"brow_ridge", 0, 1.5, Kind::none, {}, {}, "supraorbital ridge forwards"},
      {"nose_length", 53, 3.3, Kind::distance, nasion, subnasale, "nasion to subnasale (n-sn)"},
      {"nose_breadth",
       34.9,
       2.1,
       Kind::breadth,
       {column_inner_eye - 0.35, line_ala_top + 0.35},
       {},
       "between the wings of the nose (al-al)"},
      {"nose_protrusion", 19.7, 1.9, Kind::distance, pronasale, subnasale,
       "subnasale to pronasale (sn-prn)"},
      {"nasal_bridge_height", 0, 1.8, Kind::none, {}, {}, "root of the nose forwards"},
      {"nasal_bridge_width", 0, 2.0, Kind::none, {}, {}, "breadth of the nose's root"},
      {"nose_tip_height", 0, 1.8, Kind::none, {}, {}, "tip of the nose upwards"},
      {"upper_lip_height", 21.8, 2.1, Kind::distance, subnasale, stomion,
       "subnasale to stomion (sn-sto)"},
      {"mouth_width",
       53,
       3.3,
       Kind::breadth,
       {column_mouth_corner, line_upper_contact},
       {},
       "between the corners of the mouth (ch-ch)"},
      {"upper_vermilion_height", 8.0, 1.4, Kind::height, labiale_superius, stomion,
       "red of the upper lip (ls-sto)"},
      {"lower_vermilion_height", 9.3, 1.6, Kind::height, stomion, labiale_inferius,
       "red of the lower lip (sto-li)"},
      {"lip_protrusion", 0, 2.0, Kind::none, {}, {}, "lips forwards"},
      {"ear_length", 62.4, 3.7, Kind::ear, {}, {}, "top to bottom of the ear (sa-sba)"},
      {"ear_protrusion", 0, 3.0, Kind::none, {}, {}, "back of the ear away from the head"},
      {"neck_width", 0, 6.0, Kind::none, {}, {}, "breadth of the neck"}};
  return table;
}

Vector3d identity_displacement(const Place& place, const Vector3d& p, const Identity& c) {
  const Vector3d eye_forwards = depth_motion(Vector3d(eye_x_mm, 0, 0), c);
  if (place.patch == Patch::eyeball) {
    return Vector3d(0.5 * c[interpupillary_distance], 0.0, -c[eye_depth]) + eye_forwards;
  }
  if (place.patch == Patch::ear) {
    return head_motion(ear_root, c) + profile_motion(ear_root, c) + ear_motion(p, c);
  }
  const bool on_lid_lining =
      place.patch == Patch::upper_lid_inside || place.patch == Patch::lower_lid_inside;
  // The lids move with their eyeball alone.
  const double lids =
      p.z() > -20.0 || on_lid_lining
          ? 1.0 - smooth_step(std::hypot((p.x() - eye_x_mm) / 1.2, p.y()), 13.0, 27.0)
          : 0.0;
  Vector3d d = (1.0 - lids) * (head_motion(p, c) + profile_motion(p, c) + depth_motion(p, c)) +
               lids * eye_forwards;
  if (place.patch == Patch::upper_teeth || place.patch == Patch::lower_teeth) {
    return Vector3d(0, d.y(), 0) + depth_motion(p, c);
  }
  const double eye = around_eye(p.x(), p.y()) * smooth_step(p.z(), -40, -15);
  d.x() += 0.5 * c[interpupillary_distance] * eye;
  d.z() -= c[eye_depth] * eye;
  if (bump2(p.x(), p.y(), eye_x_mm, 0, 20, 20) > 1e-3 && p.z() > -20.0) {
    d += eye_motion(place, p, c) * smooth_step(p.z(), -20, -5);
  }
  return d;
}

}  // namespace semblance::face
