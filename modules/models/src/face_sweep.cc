// Positions of all patches of the built-in face.
#include "face_sweep.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "face_profile.h"
#include "face_skin.h"
#include "semblance/geometry/contour.h"

namespace semblance::face {
namespace {

using Eigen::Vector3d;

// The lids' inner surface follows the eyeball at a small distance, then dives behind it; where the
// corners reach past the eyeball the sheet stays behind the lid, as the caruncle does.
Vector3d lid_inside(const Skin& skin, const Place& place) {
  const bool upper = place.patch == Patch::upper_lid_inside;
  const Vector3d edge = skin.point(place.column, upper ? line_upper_lid : line_lower_lid);
  const Vector3d eye(eye_x_mm, 0.0, 0.0), q = edge - eye;
  const double length = q.norm();
  if (place.depth == 1) return eye + q * std::max(eye_radius_mm + 0.25, length - 1.2) / length;
  Vector3d deep = eye + q * ((length - 2.7) / length);
  const double s = skin.eye_fraction(skin.angle(place.column));
  deep.y() += (upper ? 1.0 : -1.0) * 1.2 * std::sin(std::numbers::pi * std::clamp(s, 0.0, 1.0));
  return deep;
}

// Inside of the lips, then palate or floor, then throat.
Vector3d lip_inside(const Skin& skin, const Place& place) {
  const bool upper = place.patch == Patch::upper_lip_inside;
  const double sign = upper ? 1.0 : -1.0;
  const Vector3d edge = skin.point(place.column, upper ? line_upper_contact : line_lower_contact);
  const double s = place.column / column_mouth_corner;  // roughly 0 in the middle, 1 at the corner
  const double open = std::sqrt(std::max(0.0, 1.0 - s * s));
  static constexpr std::array<std::array<double, 3>, 4> stations = {
      {{0.0, 0.4, -2.2}, {1.0, 8.0, -5.0}, {0.0, 15.0, -24.0}, {-4.0, 6.0, -52.0}}};
  const auto& st = stations[place.depth - 1];
  Vector3d p = edge;
  p.x() += st[0] * s;
  p.y() += sign * st[1] * open;
  p.z() += st[2] * (place.depth == 1 ? std::max(0.35, open) : open);
  return p;
}

Vector3d eyeball_point(const Place& place) {
  const double rho = eye_radius_mm * std::sin(place.a);
  return {eye_x_mm + rho * std::cos(place.b), rho * std::sin(place.b),
          eye_radius_mm * std::cos(place.a)};
}

Vector3d tooth_point(const Place& place) {
  const bool upper = place.patch == Patch::upper_teeth;
  const double a = std::abs(place.a), half_width = upper ? 27.0 : 24.5;
  // Parabolic arch; height of the crown falls a little towards the molars.
  const double x = half_width * std::sin(0.5 * std::numbers::pi * a * 0.93);
  const double front = upper ? 17.0 : 14.6;
  const double z = front - 34.0 * a * a * (0.35 + 0.65 * a);
  const double edge = upper ? -69.0 + 1.2 * a : -68.2 - 0.6 * a;
  const double gum = upper ? -57.0 : -79.5;
  static constexpr std::array<std::array<double, 2>, 5> section = {
      {{0.0, -1.0}, {0.45, 0.4}, {0.95, 0.0}, {1.0, -1.6}, {0.0, -4.5}}};
  const auto& st = section[static_cast<int>(place.b)];
  return {x, gum + (edge - gum) * st[0], z + st[1]};
}

Vector3d ear_point(const Place& place) {
  static const PeriodicContour outline = [] {
    Eigen::VectorXd r(12);
    r << 18, 22, 28, 31, 27, 19, 14, 15, 20, 28, 26, 20;
    return PeriodicContour(r);
  }();
  // Ring: scale of the outline, and distance outwards at helix, lobe and front (tragus).
  struct Ring {
    double scale, helix, lobe, front;
  };
  static constexpr std::array<Ring, 10> rings = {{{0.62, -14.0, -12.0, -12.0},
                                                  {0.86, -6.0, -5.0, -7.0},
                                                  {0.98, -1.0, -1.5, -4.0},
                                                  {1.00, 2.0, 0.5, -2.0},
                                                  {0.91, 3.4, 1.2, -1.0},
                                                  {0.81, 0.0, 1.2, 0.0},
                                                  {0.64, 2.8, 1.0, 1.5},
                                                  {0.49, 0.8, 0.8, 3.6},
                                                  {0.34, -4.2, -3.6, -1.6},
                                                  {0.0, -5.2, -5.2, -5.2}}};
  const int index = static_cast<int>(std::lround(place.a * 9.0));
  const Ring& ring = rings[index];
  const double lobe = std::pow(std::max(0.0, -std::sin(place.b)), 3.0);
  const double front = std::pow(std::max(0.0, -std::cos(place.b)), 2.0);
  const double helix = std::max(0.0, 1.0 - lobe - front);
  const double height = helix * ring.helix + lobe * ring.lobe + front * ring.front;
  // The concha lies towards the front and below the middle.
  const double inner = smooth_step(index, 4.0, 8.0);
  const double r = ring.scale * outline.at(place.b).value;
  const double back = 13.0 - 2.5 * inner + r * std::cos(place.b);
  const double up = -3.0 * inner + r * std::sin(place.b);
  const double flare = 0.42, tilt = 0.2;
  const Vector3d e_back(std::sin(flare), 0.0, -std::cos(flare));
  const Vector3d out(std::cos(flare), 0.0, std::sin(flare));
  const double b = back * std::cos(tilt) + up * std::sin(tilt);
  const double h = up * std::cos(tilt) - back * std::sin(tilt);
  return ear_root + b * e_back + h * Vector3d::UnitY() + height * out;
}

Vector3d place_point(const Skin& skin, const Place& place) {
  switch (place.patch) {
    case Patch::skin:
      return skin.point(place.column, place.row);
    case Patch::upper_lid_inside:
    case Patch::lower_lid_inside:
      return lid_inside(skin, place);
    case Patch::upper_lip_inside:
    case Patch::lower_lip_inside:
      return lip_inside(skin, place);
    case Patch::eyeball:
      return eyeball_point(place);
    case Patch::upper_teeth:
    case Patch::lower_teeth:
      return tooth_point(place);
    case Patch::ear:
      return ear_point(place);
  }
  return Vector3d::Zero();
}

}  // namespace

Sweep::Sweep(std::vector<Place> places) : places_(std::move(places)) {
  static const Skin skin;
  for (const Place& place : places_) contours_.push_back(place_point(skin, place));
}

Points Sweep::at(const Identity& identity) const {
  Points points(static_cast<Eigen::Index>(places_.size()), 3);
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const Place& place = places_[i];
    Vector3d p = contours_[i] + identity_displacement(place, contours_[i], identity);
    // The middle stays in the middle; the right half mirrors the left.
    p.x() *= place.side;
    points.row(static_cast<Eigen::Index>(i)) = p;
  }
  return points;
}

Points sweep(const std::vector<Place>& places, const Identity& identity) {
  return Sweep(places).at(identity);
}

}  // namespace semblance::face
