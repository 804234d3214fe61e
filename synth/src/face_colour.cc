#include "face_colour.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "noise.h"
#include "semblance/core/conventions.h"

namespace semblance {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

constexpr float kPi = std::numbers::pi_v<float>;

Vector3f linear_rgb(int r, int g, int b) {
  return {linear_from_srgb(r / 255.0f), linear_from_srgb(g / 255.0f), linear_from_srgb(b / 255.0f)};
}

Vector3f mix(const Vector3f& a, const Vector3f& b, float t) { return a + (b - a) * t; }

// Points of a Catmull-Rom spline through the corners, eight per span.
std::vector<Vector2f> spline(const std::vector<Vector2f>& corners, bool closed) {
  constexpr int kSteps = 8;
  const int count = static_cast<int>(corners.size());
  const auto at = [&](int i) {
    return closed ? corners[(i + count) % count] : corners[std::clamp(i, 0, count - 1)];
  };
  std::vector<Vector2f> points;
  const int spans = closed ? count : count - 1;
  for (int i = 0; i < spans; ++i) {
    const Vector2f p0 = at(i - 1), p1 = at(i), p2 = at(i + 1), p3 = at(i + 2);
    for (int k = 0; k < kSteps; ++k) {
      const float t = static_cast<float>(k) / kSteps;
      points.push_back(0.5f * (2 * p1 + (p2 - p0) * t + (2 * p0 - 5 * p1 + 4 * p2 - p3) * t * t +
                               (3 * p1 - p0 - 3 * p2 + p3) * t * t * t));
    }
  }
  if (!closed) points.push_back(corners.back());
  return points;
}

struct Nearest {
  float distance = 1e9f;
  float along = 0.0f;  // 0 at the curve's first point, 1 at its last
  float side = 0.0f;   // signed distance, positive to the left of the direction of travel
};

Nearest nearest_on(const std::vector<Vector2f>& curve, const Vector2f& p) {
  Nearest best;
  for (std::size_t i = 0; i + 1 < curve.size(); ++i) {
    const Vector2f step = curve[i + 1] - curve[i];
    const float t = std::clamp((p - curve[i]).dot(step) / step.squaredNorm(), 0.0f, 1.0f);
    const Vector2f gap = p - curve[i] - t * step;
    const float distance = gap.norm();
    if (distance >= best.distance) continue;
    best.distance = distance;
    best.along = (static_cast<float>(i) + t) / static_cast<float>(curve.size() - 1);
    best.side = (step.x() * gap.y() - step.y() * gap.x()) > 0 ? distance : -distance;
  }
  return best;
}

bool inside(const std::vector<Vector2f>& polygon, const Vector2f& p) {
  bool in = false;
  for (std::size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
    const Vector2f &a = polygon[i], &b = polygon[j];
    if ((a.y() > p.y()) != (b.y() > p.y()) &&
        p.x() < (b.x() - a.x()) * (p.y() - a.y()) / (b.y() - a.y()) + a.x())
      in = !in;
  }
  return in;
}

float blob(const Vector3f& p, const Vector3f& centre, float radius) {
  return std::exp(-(p - centre).squaredNorm() / (radius * radius));
}

}  // namespace

PersonLook draw_person(Random& random, double skin_tone, double stubble) {
  PersonLook look;
  look.noise_seed = static_cast<std::uint32_t>(random.integer(1 << 30));
  const double tone = random.uniform(0.0, 1.0);
  look.skin_tone = static_cast<float>(skin_tone >= 0 ? skin_tone : tone);
  look.redness = static_cast<float>(random.uniform(-0.3, 1.0));
  look.freckles = static_cast<float>(std::pow(random.uniform(), 3.0));
  const double beard = random.uniform(-0.8, 0.8);
  look.stubble = static_cast<float>(stubble >= 0 ? stubble : std::max(0.0, beard));
  look.lip_strength = static_cast<float>(random.uniform(0.5, 1.0));
  look.brow_thickness = static_cast<float>(random.uniform(0.75, 1.25));
  look.hair_height_m = static_cast<float>(random.uniform(0.006, 0.020));
  look.hairline_m = static_cast<float>(random.uniform(0.046, 0.062));
  // From black over browns to blond and grey; light hair is drawn with light skin only.
  const std::array<Vector3f, 6> hairs = {linear_rgb(24, 20, 19),   linear_rgb(44, 30, 22),
                                         linear_rgb(70, 47, 32),   linear_rgb(104, 72, 44),
                                         linear_rgb(150, 118, 78), linear_rgb(120, 114, 108)};
  look.hair = hairs[random.integer(look.skin_tone > 0.6f ? 6 : 2)];
  const std::array<Vector3f, 5> irises = {linear_rgb(58, 36, 22), linear_rgb(84, 54, 30),
                                          linear_rgb(104, 88, 52), linear_rgb(86, 110, 122),
                                          linear_rgb(96, 112, 92)};
  look.iris = irises[random.integer(look.skin_tone > 0.6f ? 5 : 2)];
  const std::array<Vector3f, 6> cloths = {linear_rgb(46, 58, 92),    linear_rgb(120, 124, 128),
                                          linear_rgb(34, 36, 38),    linear_rgb(142, 52, 48),
                                          linear_rgb(148, 144, 134), linear_rgb(62, 96, 74)};
  look.cloth = cloths[random.integer(6)];
  return look;
}

Vector3f skin_albedo(float tone) {
  const Vector3f dark = linear_rgb(115, 82, 68), light = linear_rgb(194, 150, 130);
  const float t = -0.1f + 1.2f * tone;
  return (dark.array().log() * (1 - t) + light.array().log() * t).exp();
}

FaceColour::FaceColour(const PersonLook& look, const NeutralLandmarks& landmarks, float crown_y_m)
    : look_(look), landmarks_(landmarks), base_(skin_albedo(look.skin_tone)), crown_y_(crown_y_m) {
  const auto flat = [&](std::initializer_list<int> indices) {
    std::vector<Vector2f> out;
    for (const int i : indices) out.push_back(landmarks[i].head<2>());
    return out;
  };
  lips_ = spline(flat({48, 49, 50, 51, 52, 53, 54, 55, 56, 57, 58, 59}), true);
  lip_line_ = spline(flat({60, 61, 62, 63, 64}), false);
  // Brows run from the nose outwards, lids from the outer to the inner corner.
  brows_ = {spline(flat({21, 20, 19, 18, 17}), false), spline(flat({22, 23, 24, 25, 26}), false)};
  upper_lids_ = {spline(flat({36, 37, 38, 39}), false), spline(flat({45, 44, 43, 42}), false)};
  lower_lids_ = {spline(flat({36, 41, 40, 39}), false), spline(flat({45, 46, 47, 42}), false)};
  for (int i = 17; i < 27; ++i) brow_y_ += landmarks[i].y() / 10;
  // The head's vertical axis runs about midway between the face and the back of the head.
  axis_z_ = landmarks[27].z() - 0.10f;
}

bool FaceColour::in_front(const Vector3f& p) const { return p.z() > landmarks_[36].z() - 0.03f; }

Vector3f FaceColour::skin(const Vector3f& p) const {
  Vector3f colour = base_;
  apply_zones(p, colour);
  apply_spots(p, colour);
  if (in_front(p)) apply_lips(p, colour);
  apply_stubble(p, colour);
  if (in_front(p)) {
    apply_eye_rims(p, colour);
    apply_brows(p, colour);
  }
  apply_hair(p, colour);
  return colour.cwiseMax(0.004f).cwiseMin(0.95f);
}

// Blood shows on cheeks, nose and ears; the lids are darker; blotches and pores lie over all.
void FaceColour::apply_zones(const Vector3f& p, Vector3f& colour) const {
  const std::uint32_t seed = look_.noise_seed;
  float red = 0.0f, dark = 0.0f;
  for (const int side : {0, 1}) {
    const Vector3f outer = landmarks_[side == 0 ? 36 : 45], inner = landmarks_[side == 0 ? 39 : 42];
    const Vector3f eye = 0.5f * (outer + inner);
    const Vector3f mouth = landmarks_[side == 0 ? 48 : 54];
    Vector3f cheek = 0.5f * (eye + mouth);
    cheek.x() *= 1.35f;
    red += blob(p, cheek, 0.026f) + 0.8f * blob(p, landmarks_[side == 0 ? 1 : 15], 0.03f);
    dark += 0.9f * blob(p, eye + Vector3f(0, -0.011f, 0), 0.013f) + blob(p, eye, 0.014f);
    dark += 3.0f * blob(p, landmarks_[side == 0 ? 32 : 34] + Vector3f(0, 0.0f, -0.003f), 0.004f);
  }
  red += 1.0f * blob(p, landmarks_[30], 0.016f) + 0.5f * blob(p, landmarks_[8], 0.02f);
  red += 0.7f * fractal_noise(p / 0.018f, 3, seed + 11);
  const float flush = std::clamp(0.10f * (0.6f + 0.6f * look_.redness) * red, -0.2f, 0.25f);
  colour = colour.cwiseProduct(Vector3f(1 + 0.25f * flush, 1 - 0.9f * flush, 1 - 0.8f * flush));
  colour *= 1 - 0.11f * std::min(dark, 3.0f);
  const float blotch = 0.06f * fractal_noise(p / 0.025f, 4, seed + 23);
  const float pores = 0.09f * fractal_noise(p / 0.0030f, 3, seed + 31);
  colour *= 1 + blotch + pores;
}

// Freckles and moles: discs of random size in the cells of a lattice.
void FaceColour::apply_spots(const Vector3f& p, Vector3f& colour) const {
  struct Layer {
    float cell_m, share, smallest_m, largest_m, depth;
  };
  const float sun = std::exp(-std::pow((p.y() - landmarks_[29].y()) / 0.05f, 2.0f));
  const std::array<Layer, 2> layers = {
      Layer{0.005f, 0.6f * look_.freckles * sun, 0.0005f, 0.0013f, 0.28f},
      Layer{0.035f, 0.22f, 0.0007f, 0.0016f, 0.6f}};
  for (std::size_t l = 0; l < layers.size(); ++l) {
    const Layer& layer = layers[l];
    const std::uint32_t seed = look_.noise_seed + 101 * static_cast<std::uint32_t>(l + 1);
    const Vector3f q = p / layer.cell_m;
    const Eigen::Vector3i cell = q.array().floor().cast<int>();
    if (cell_value(cell.x(), cell.y(), cell.z(), seed) > layer.share) continue;
    Vector3f centre;
    for (int k = 0; k < 3; ++k)
      centre[k] = static_cast<float>(cell[k]) + 0.3f +
                  0.4f * cell_value(cell.x(), cell.y(), cell.z(), seed + 7 + k);
    const float size = cell_value(cell.x(), cell.y(), cell.z(), seed + 3);
    const float radius = layer.smallest_m + (layer.largest_m - layer.smallest_m) * size * size;
    const float distance = (q - centre).norm() * layer.cell_m;
    const float cover = layer.depth * (1 - smooth_step(0.6f * radius, 1.2f * radius, distance));
    colour = colour.cwiseProduct(mix(Vector3f::Ones(), Vector3f(0.75f, 0.5f, 0.4f), cover));
  }
}

float FaceColour::lip_distance(const Vector3f& p) const {
  const Vector2f q = p.head<2>();
  Curve closed = lips_;
  closed.push_back(lips_.front());
  const float distance = nearest_on(closed, q).distance;
  return inside(lips_, q) ? -distance : distance;
}

void FaceColour::apply_lips(const Vector3f& p, Vector3f& colour) const {
  if ((p - landmarks_[62]).norm() > 0.05f) return;
  const float ragged = 0.0004f * gradient_noise(p / 0.002f, look_.noise_seed + 41);
  const float cover = 1 - smooth_step(-0.0010f, 0.0007f, lip_distance(p) + ragged);
  if (cover <= 0) return;
  const Vector3f tint =
      mix(Vector3f(0.95f, 0.72f, 0.72f), Vector3f(0.82f, 0.40f, 0.42f), look_.lip_strength);
  // Fine upright wrinkles, and a darker line where the lips meet.
  const float wrinkles =
      0.08f * gradient_noise(Vector3f(p.x() / 0.0012f, p.y() / 0.008f, p.z() / 0.008f),
                             look_.noise_seed + 43);
  const float meeting = nearest_on(lip_line_, p.head<2>()).distance;
  const float shade = 1 + wrinkles - 0.35f * (1 - smooth_step(0.0f, 0.0022f, meeting));
  colour = mix(colour, (base_.cwiseProduct(tint) * shade).eval(), cover);
}

void FaceColour::apply_stubble(const Vector3f& p, Vector3f& colour) const {
  if (look_.stubble <= 0) return;
  const Vector3f mouth = landmarks_[62];
  const float lip_to_nose = landmarks_[33].y();
  float area = 1 - smooth_step(lip_to_nose - 0.012f, lip_to_nose - 0.002f,
                               p.y() - 0.35f * std::max(0.0f, std::abs(p.x()) - 0.03f));
  area *= smooth_step(landmarks_[8].y() - 0.05f, landmarks_[8].y() - 0.01f, p.y());
  area *= smooth_step(axis_z_ - 0.005f, axis_z_ + 0.03f, p.z());
  if (area <= 0) return;
  if ((p - mouth).norm() < 0.05f) area *= smooth_step(0.001f, 0.005f, lip_distance(p));
  const float grain = 0.5f + 0.9f * gradient_noise(p / 0.0011f, look_.noise_seed + 53);
  const float patch = 0.75f + 0.3f * fractal_noise((p - mouth) / 0.012f, 2, look_.noise_seed + 59);
  const float cover = std::clamp(look_.stubble * area * patch * (0.35f + 0.5f * grain), 0.0f, 0.8f);
  colour = mix(colour, (0.6f * look_.hair + 0.25f * base_).eval(), cover);
}

void FaceColour::apply_eye_rims(const Vector3f& p, Vector3f& colour) const {
  const Vector2f q = p.head<2>();
  for (int side = 0; side < 2; ++side) {
    if ((p - landmarks_[side == 0 ? 37 : 44]).norm() > 0.04f) continue;
    const Nearest upper = nearest_on(upper_lids_[side], q);
    const Nearest lower = nearest_on(lower_lids_[side], q);
    const float lash = 0.9f * (1 - smooth_step(0.0004f, 0.0017f, upper.distance)) +
                       0.35f * (1 - smooth_step(0.0002f, 0.0013f, lower.distance));
    colour = mix(colour, (0.35f * look_.hair).eval(), std::min(lash, 0.92f));
  }
}

// Hairs along strokes that fan from upright near the nose to lying along the brow outside.
void FaceColour::apply_brows(const Vector3f& p, Vector3f& colour) const {
  for (int side = 0; side < 2; ++side) {
    if ((p - landmarks_[side == 0 ? 19 : 24]).norm() > 0.05f) continue;
    const Nearest near = nearest_on(brows_[side], p.head<2>());
    if (near.distance > 0.015f) continue;
    const float along = near.along;
    const float half = 0.0048f * look_.brow_thickness *
                       (0.75f + 0.5f * std::sin(kPi * std::min(1.0f, along * 1.3f + 0.1f))) *
                       (1 - 0.75f * smooth_step(0.55f, 1.0f, along));
    // On the right side of the face the curve runs towards -x, so its left side is below.
    const float above = side == 0 ? -near.side : near.side;
    const float lean = (side == 0 ? -1.0f : 1.0f) * (0.2f + 1.1f * smooth_step(0.0f, 0.5f, along));
    const float across = (p.x() - lean * above) / 0.00075f;
    const float stroke =
        gradient_noise(Vector3f(across, above / 0.006f, 0.0f), look_.noise_seed + 61);
    const float edge = near.distance + 0.0012f * stroke;
    const float ends = smooth_step(-0.02f, 0.06f, along) * (1 - smooth_step(0.93f, 1.0f, along));
    const float body = (1 - smooth_step(0.45f * half, 1.15f * half, edge)) * ends;
    const float cover = std::clamp(body * (0.9f + 0.5f * stroke), 0.0f, 0.97f);
    colour = mix(colour, (0.7f * look_.hair + 0.03f * base_).eval(), cover);
  }
}

float FaceColour::hair_cover(const Vector3f& p) const {
  const float azimuth = std::atan2(std::abs(p.x()), p.z() - axis_z_) * 180 / kPi;
  const float eye_y = landmarks_[36].y();
  // Height of the hairline: forehead, receding corner, temple, sideburn, above the ear, nape.
  struct Knot {
    float azimuth_deg, y_m;
  };
  const float top = brow_y_ + look_.hairline_m;
  const std::array<Knot, 8> knots = {Knot{0, top},
                                     Knot{22, top + 0.002f},
                                     Knot{42, top - 0.010f},
                                     Knot{58, brow_y_ + 0.012f},
                                     Knot{72, eye_y - 0.014f},
                                     Knot{84, eye_y - 0.006f},
                                     Knot{112, eye_y - 0.012f},
                                     Knot{135, eye_y - 0.080f}};
  float line = knots.back().y_m;
  for (std::size_t i = 0; i + 1 < knots.size(); ++i) {
    if (azimuth >= knots[i + 1].azimuth_deg) continue;
    const float t = smooth_step(knots[i].azimuth_deg, knots[i + 1].azimuth_deg, azimuth);
    line = knots[i].y_m + (knots[i + 1].y_m - knots[i].y_m) * t;
    break;
  }
  return smooth_step(line - 0.003f, line + 0.006f, p.y());
}

void FaceColour::apply_hair(const Vector3f& p, Vector3f& colour) const {
  const float azimuth = std::atan2(p.x(), p.z() - axis_z_);
  const Vector3f strand_place(azimuth / 0.012f, p.y() / 0.05f, p.z() / 0.05f);
  const float strand = gradient_noise(strand_place, look_.noise_seed + 71);
  const float coarse = fractal_noise(Vector3f(azimuth / 0.12f, p.y() / 0.06f, p.z() / 0.06f), 3,
                                     look_.noise_seed + 73);
  const float fringe = 0.004f * strand;
  const float cover = hair_cover(p + Vector3f(0, fringe, 0));
  if (cover <= 0) return;
  const float shade = std::max(0.3f, 1 + 0.45f * strand + 0.35f * coarse);
  colour = mix(colour, (look_.hair * shade).eval(), std::min(1.0f, cover * 1.05f));
}

Vector3f FaceColour::eye(const Vector2f& offset, float iris_radius) const {
  const float radius = offset.norm(), angle = std::atan2(offset.y(), offset.x());
  const float tone = 0.85f + 0.15f * look_.skin_tone;
  Vector3f sclera = tone * Vector3f(0.42f, 0.375f, 0.35f);
  const float veins =
      fractal_noise(Vector3f(3 * std::cos(angle), 3 * std::sin(angle), radius / 0.003f), 3,
                    look_.noise_seed + 83);
  const float far_out = smooth_step(iris_radius, 2 * iris_radius, radius);
  sclera = sclera.cwiseProduct(
      Vector3f(1, 1 - 0.2f * far_out * (0.6f + veins), 1 - 0.2f * far_out * (0.6f + veins)));
  const float fibre = gradient_noise(
      Vector3f(9 * std::cos(angle), 9 * std::sin(angle), radius / 0.004f), look_.noise_seed + 89);
  const float inward = 1 - smooth_step(0.35f * iris_radius, 0.7f * iris_radius, radius);
  Vector3f iris = look_.iris * (1 + 0.35f * fibre + 0.35f * inward);
  iris *= 1 - 0.75f * smooth_step(0.80f * iris_radius, 0.98f * iris_radius, radius);  // limbus
  const float pupil = 1 - smooth_step(0.33f * iris_radius, 0.38f * iris_radius, radius);
  iris = mix(iris, Vector3f::Constant(0.006f), pupil);
  return mix(iris, sclera, smooth_step(0.95f * iris_radius, 1.06f * iris_radius, radius));
}

}  // namespace semblance
