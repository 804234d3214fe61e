// The head's skin: contours joined by homotopies, with the relief of nose, eyes and lips.
#include "face_skin.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "face_contours.h"
#include "face_profile.h"
#include "semblance/geometry/contour.h"

namespace semblance::face {
namespace {

constexpr double degree = std::numbers::pi / 180.0;

// Angles of the feature columns about the vertical axis through (0, axis_z).
constexpr std::array<double, column_count> column_deg = {0,    3.4, 7.8, 11.3, 17.3, 24.0, 31.8,
                                                         45.0, 62,  85,  110,  145,  180};

// Heights (path coordinate, see height_from_path) of the feature lines at the feature columns.
// clang-format off
constexpr double heights[line_count][column_count] = {
    {162, 162, 162, 162, 162, 162, 162, 162, 162, 162, 162, 162, 162},
    {80,   80,  80,  80,  80,  80,  79,  76,  70,  62,  58,  55,  55},
    {23,   23.5, 25, 27,  29,  30.5, 29, 26,  24,  24,  24,  24,  24},
    {14,   14.5, 15, 15.5, 16.5, 17.5, 17, 14, 12,  12,  12,  12,  12},
    {5.5,  5.5, 5.3,  4,  8.0,  9.6, 4.6,  5,  5,   5,   5,   5,   5},
    {0,    -0.2, -0.8, -2.0, -1.6, -1.0, -0.2, -1, -2, -2, -2, -2, -2},
    {0,    -0.2, -0.8, -2.0, -1.6, -1.0, -0.2, -1, -2, -2, -2, -2, -2},
    {-12, -12, -12, -12.5, -14, -14.5, -12, -11, -12, -12, -12, -12, -12},
    {-23, -23, -23, -23, -23.5, -24, -23, -22, -22, -22, -22, -22, -22},
    {-32, -32, -32, -31.5, -32, -32, -32, -31, -30, -29, -29, -29, -29},
    {-39.5, -39.5, -39.5, -39, -39.5, -40, -40, -38, -36, -34, -34, -34, -34},
    {-46.5, -46.5, -46.5, -46.5, -47, -47, -47, -45, -42, -39, -39, -39, -39},
    {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0},
    {-67, -67, -66.8, -67, -68, -66, -63.5, -58, -52, -46, -46, -46, -46},
    {-67, -67, -66.8, -67, -68, -66, -63.5, -58, -52, -46, -46, -46, -46},
    {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0},
    {-85, -85, -85, -85, -84, -81.5, -78, -70, -62, -52, -52, -52, -52},
    {-98, -98, -98, -97.5, -96, -92.5, -88, -81, -74, -64, -59, -57, -57},
    {-113, -113, -112.5, -111.5, -109, -105, -100, -92, -83, -72, -66, -64, -64},
    {-119, -119, -119, -118.8, -118, -116, -113, -106, -97, -86, -84, -86, -86},
    {-155, -155, -155, -155, -155, -155, -155, -155, -155, -155, -155, -155, -155}};
// Distance of the vermilion borders from the line of contact.
constexpr std::array<double, column_count> upper_vermilion = {7.6, 8.6, 6.6, 4.4, 1.3, 3.2, 4.5,
                                                              4.5, 4,   3,   3,   3,   3};
constexpr std::array<double, column_count> lower_vermilion = {9.2, 9.1, 7.8, 5.4, 1.5, 3.6, 4.8,
                                                              4.5, 4,   3,   3,   3,   3};
// clang-format on

Eigen::VectorXd full_turn(const std::vector<double>& half) {
  const int n = static_cast<int>(half.size());
  Eigen::VectorXd full(2 * n - 2);
  for (int i = 0; i < n; ++i) full[i] = half[i];
  for (int i = 1; i < n - 1; ++i) full[2 * n - 2 - i] = half[i];
  return full;
}

Eigen::VectorXd mirrored_angles(std::vector<double> half_deg) {
  Eigen::VectorXd full = full_turn(half_deg);
  const Eigen::Index n = static_cast<Eigen::Index>(half_deg.size());
  for (Eigen::Index i = n; i < full.size(); ++i) full[i] = 360.0 - full[i];
  return full * degree;
}

template <std::size_t N>
ContourStack contour_stack(const std::array<HeadContour, N>& rows) {
  const Eigen::VectorXd angles =
      mirrored_angles({contour_angles_deg.begin(), contour_angles_deg.end()});
  std::vector<double> path;
  std::vector<PeriodicContour> contours;
  for (const HeadContour& row : rows) {
    path.push_back(row.path);
    contours.emplace_back(angles, full_turn({row.radius_mm.begin(), row.radius_mm.end()}));
  }
  return {path, contours};
}

PeriodicContour column_contour(const double* values) {
  return {mirrored_angles({column_deg.begin(), column_deg.end()}),
          full_turn({values, values + column_count})};
}

double radius_at(const ContourStack& stack, double u, double path) {
  const auto& h = stack.heights();
  const double p = std::clamp(path, h.front(), h.back());
  const int i = std::clamp<int>(std::upper_bound(h.begin(), h.end(), p) - h.begin() - 1, 0,
                                stack.contour_count() - 2);
  return stack.at(u, i + (p - h[i]) / (h[i + 1] - h[i])).r;
}

// Value through stations by homotopies with slopes from the neighbours.
struct Station {
  double x, value;
};
template <std::size_t N>
double through(const std::array<Station, N>& s, double x) {
  if (x <= s[0].x) return s[0].value;
  if (x >= s[N - 1].x) return s[N - 1].value;
  std::size_t i = 0;
  while (x > s[i + 1].x) ++i;
  const auto slope = [&](std::size_t k) {
    if (k == 0) return (s[1].value - s[0].value) / (s[1].x - s[0].x);
    if (k == N - 1) return (s[N - 1].value - s[N - 2].value) / (s[N - 1].x - s[N - 2].x);
    return (s[k + 1].value - s[k - 1].value) / (s[k + 1].x - s[k - 1].x);
  };
  const double h = s[i + 1].x - s[i].x;
  return HomotopyPath{s[i].value, s[i + 1].value, slope(i) * h, slope(i + 1) * h}
      .at((x - s[i].x) / h)
      .value;
}

// Height of an ellipsoid over the frontal plane; falls off steeply outside its outline.
double dome(double x, double y, double cx, double cy, double cz, double rx, double ry, double rz) {
  const double q = std::pow((x - cx) / rx, 2) + std::pow((y - cy) / ry, 2);
  if (q < 0.9) return cz + rz * std::sqrt(1.0 - q);
  return cz + rz * (std::sqrt(0.1) - (q - 0.9) / (2.0 * std::sqrt(0.1)));
}

// z of the nose over the frontal plane; far below the face elsewhere.
double nose(double x, double y) {
  static constexpr std::array<Station, 16> ridge = {{{-56, 4},
                                                     {-51, 17},
                                                     {-48, 26},
                                                     {-46, 30},
                                                     {-44, 32.5},
                                                     {-41.5, 35.5},
                                                     {-39, 39},
                                                     {-36.5, 42.5},
                                                     {-33, 44.8},
                                                     {-28, 43.6},
                                                     {-20, 39},
                                                     {-10, 31.8},
                                                     {-3, 27},
                                                     {4, 24},
                                                     {12, 22.4},
                                                     {21, 22}}};
  static constexpr std::array<Station, 6> roundness = {
      {{-47, 3.6}, {-37, 5.6}, {-26, 5.6}, {-12, 5.5}, {2, 5.5}, {14, 9}}};
  static constexpr std::array<Station, 6> steepness = {
      {{-48, 2.3}, {-36, 2.1}, {-26, 1.9}, {-12, 1.75}, {2, 1.55}, {14, 0.8}}};
  const double rho = through(roundness, y);
  double z = through(ridge, y) - through(steepness, y) * (std::hypot(x, rho) - rho);
  z = smooth_max(z, dome(x, y, 0, -33.2, 34.5, 9.2, 8.0, 10.6), 1.2);
  z = smooth_max(z, dome(x, y, 10.6, -34.8, 21.8, 6.6, 8.0, 13.0), 1.0);
  return z;
}

double arch(double s, double skew, double power) {
  if (s <= 0.0 || s >= 1.0) return 0.0;
  return std::pow(std::sin(std::numbers::pi * std::pow(s, skew)), power);
}

}  // namespace

double height_from_path(double path) {
  return path <= 45.0 ? path : 45.0 + 75.0 * std::sin((path - 45.0) / 75.0);
}

struct Skin::Numbers {
  ContourStack head = contour_stack(head_contours);
  ContourStack neck = contour_stack(neck_contours);
  std::vector<PeriodicContour> lines;
  PeriodicContour upper = column_contour(upper_vermilion.data());
  PeriodicContour lower = column_contour(lower_vermilion.data());
  Numbers() {
    for (int i = 0; i < line_count; ++i) lines.push_back(column_contour(heights[i]));
  }
};

Skin::Skin() : numbers_(std::make_unique<Numbers>()) {}
Skin::~Skin() = default;

double Skin::angle(double column) const {
  const int i = std::clamp(static_cast<int>(column), 0, column_count - 2);
  return degree * (column_deg[i] + (column - i) * (column_deg[i + 1] - column_deg[i]));
}

double Skin::eye_fraction(double u) const {
  return (u / degree - column_deg[column_inner_eye]) /
         (column_deg[column_outer_eye] - column_deg[column_inner_eye]);
}

double Skin::line_path(int line, double u) const {
  const Numbers& n = *numbers_;
  const double eye = eye_fraction(u);
  switch (line) {
    case line_upper_lid:
      return n.lines[line].at(u).value + 5.5 * arch(eye, 0.86, 0.72);
    case line_lower_lid:
      return n.lines[line].at(u).value - 4.9 * arch(eye, 1.12, 0.80);
    case line_upper_vermilion:
      return n.lines[line_upper_contact].at(u).value + n.upper.at(u).value;
    case line_lower_vermilion:
      return n.lines[line_lower_contact].at(u).value - n.lower.at(u).value;
    default:
      return n.lines[line].at(u).value;
  }
}

double Skin::path(double u, double row) const {
  const int i = std::clamp(static_cast<int>(row), 0, line_count - 2);
  const double t = row - i, p0 = line_path(i, u), p1 = line_path(i + 1, u);
  // Harmonic slopes keep the rows in order; slits and ends take the chord.
  const double chord = p1 - p0;
  const auto joined = [&](int line, double other) {
    const bool slit = line == line_upper_lid || line == line_lower_lid ||
                      line == line_upper_contact || line == line_lower_contact;
    if (slit || other * chord <= 0.0) return chord;
    return 2.0 * other * chord / (other + chord);
  };
  const double before = i > 0 ? p0 - line_path(i - 1, u) : chord;
  const double after = i + 2 < line_count ? line_path(i + 2, u) - p1 : chord;
  return HomotopyPath{p0, p1, joined(i, before), joined(i + 1, after)}.at(t).value;
}

double Skin::lip_relief(double u, double y) const {
  static constexpr std::array<Station, 8> upper_profile = {{{0, 0.2},
                                                            {0.10, 0.56},
                                                            {0.26, 0.87},
                                                            {0.5, 1.0},
                                                            {0.75, 0.95},
                                                            {1.0, 0.72},
                                                            {1.7, 0.12},
                                                            {2.4, 0}}};
  static constexpr std::array<Station, 8> lower_profile = {{{0, 0.2},
                                                            {0.10, 0.58},
                                                            {0.27, 0.86},
                                                            {0.48, 1.0},
                                                            {0.75, 0.82},
                                                            {1.0, 0.46},
                                                            {1.35, 0.08},
                                                            {1.8, 0}}};
  const double s = u / (degree * column_deg[column_mouth_corner]);
  const double contact = line_path(line_upper_contact, u);
  const double fullness = s < 1.0 ? std::pow(1.0 - s * s, 0.8) : 0.0;
  const double corner = -1.6 * bump(s, 1.0, 0.22) * bump(y, contact, 5.0);
  if (y >= contact) {
    const double eta = (y - contact) / std::max(2.5, numbers_->upper.at(u).value);
    return corner + 3.6 * fullness * through(upper_profile, eta);
  }
  const double eta = (contact - y) / std::max(2.5, numbers_->lower.at(u).value);
  return corner + 3.8 * fullness * through(lower_profile, eta);
}

Eigen::Vector3d Skin::point(double column, double row) const {
  if (row == line_vertex) return {0.0, height_from_path(162.8), axis_z};
  const Numbers& n = *numbers_;
  const double u = angle(column), tau = path(u, row);
  const double y = height_from_path(tau);
  const double jaw = n.lines[line_jaw].at(u).value;
  double r = radius_at(n.head, u, tau);
  if (row < line_neck + 1 && u < 2.2)
    r -= 3.5 * std::exp(-std::max(0.0, y - jaw) / 4.0) * smooth_step(u, 0.0, 0.6) *
         (1.0 - smooth_step(u, 1.0, 1.5));
  if (row > line_jaw) {
    const double b = smooth_step(row, line_jaw, line_neck + 0.35);
    r = (1.0 - b) * r + b * radius_at(n.neck, u, std::min(tau, -60.0));
  }
  const double x = r * std::sin(u);
  double z = axis_z + r * std::cos(u);
  if (u > 1.3) return {x, y, z};

  z += 2.4 * bump2(x, y, 18, 19.5, 18, 8.5);  // supraorbital ridge
  z += -4.0 * bump2(x, y, 28, 4, 13, 10);     // orbit
  z += -2.8 * bump2(x, y, 17.5, 2, 6, 9);     // inner corner of the orbit
  z += -1.4 * bump2(x, y, 31, -16, 10, 7);    // below the lid
  z += -2.5 * bump2(x, y, 0, -86, 20, 5.5);   // mentolabial fold
  z += 2.5 * bump2(x, y, 0, -99, 15, 8);      // chin
  z += -1.3 * bump2(x, y, 0, -53, 2.8, 6.5);  // philtrum
  z += 0.7 * bump2(x, y, 5.2, -54, 2.2, 6.0);
  // Nasolabial fold: a shallow valley from the wing of the nose past the corner of the mouth.
  const double fold = 20.0 + 0.40 * std::max(0.0, -36.0 - y);
  z += -1.1 * bump(x, fold, 3.2) * smooth_step(-y, 34, 44) * (1.0 - smooth_step(-y, 58, 76));
  z += lip_relief(u, y);
  if (x < 30.0 && y > -52.0 && y < 21.0) z = smooth_max(z, nose(x, y), 1.2);

  // Lids: a shell around the eyeball.
  const double d2 = std::pow(x - eye_x_mm, 2) + y * y, shell = eye_radius_mm + 1.0;
  if (d2 < 16.0 * 16.0) {
    const double cut = 0.97 * shell, edge = std::sqrt(shell * shell - cut * cut);
    const double d = std::sqrt(d2);
    const double dome_z = d < cut ? std::sqrt(shell * shell - d2) : edge - (d - cut) * cut / edge;
    z = smooth_max(z, dome_z, 0.7);
  }
  const double s = eye_fraction(u);
  const double over_eye = smooth_step(s, -0.25, 0.25) * (1.0 - smooth_step(s, 0.85, 1.35));
  z += over_eye * (-1.3 * bump(row, line_lid_crease + 0.05, 0.22) +
                   1.6 * bump(row, line_lid_crease - 0.55, 0.35));
  Eigen::Vector3d p(x, y, z);
  // Nostrils: hollows in the underside of the nose.
  const double hollow = bump2(x, y, 6.4, -41.6, 2.6, 1.8);
  p += hollow * Eigen::Vector3d(0.0, 2.6, -5.0);
  return p;
}

}  // namespace semblance::face
