#include "lip_paint.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "noise.h"
#include "semblance/core/errors.h"
#include "semblance/models/lip_points.h"

namespace semblance {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr float kInnerShare = 0.35f;     // of the way from the inner to the outer border
constexpr float kLeastDiameters = 2.0f;  // between an outer dot and its inner neighbour
constexpr float kRimM = 0.0001f;         // half width of a dot's soft edge

// Where a brush that comes from the front meets the skin: the foremost point over (x, y).
LipPaint::Dot touch(const Mesh& skin, const Vector3f& target_m) {
  LipPaint::Dot dot;
  double foremost_m = -1e9;
  for (Eigen::Index t = 0; t < skin.triangle_count(); ++t) {
    const Eigen::Vector3i corners = skin.triangles.row(t);
    const Vector3d a = skin.positions_m.row(corners[0]), b = skin.positions_m.row(corners[1]),
                   c = skin.positions_m.row(corners[2]);
    Eigen::Matrix2d edges;
    edges << (b - a).head<2>(), (c - a).head<2>();
    if (edges.determinant() <= 1e-14) continue;  // seen from behind, or edge-on
    const Vector2d uv = edges.inverse() * (target_m.head<2>().cast<double>() - a.head<2>());
    if (uv.minCoeff() < 0 || uv.sum() > 1) continue;
    const Vector3d place = a + uv.x() * (b - a) + uv.y() * (c - a);
    if (place.z() <= foremost_m) continue;
    foremost_m = place.z();
    dot.corners = {corners[0], corners[1], corners[2]};
    dot.weights = Vector3d(1 - uv.sum(), uv.x(), uv.y()).cast<float>();
    dot.centre_m = place.cast<float>();
  }
  if (foremost_m <= -1e9)
    throw InvalidInput("face model: it has no skin where a lip marker should be painted");
  return dot;
}

}  // namespace

LipPaint::LipPaint(const MarkerSpec& spec, const NeutralLandmarks& landmarks, const Mesh& skin)
    : radius_m_(static_cast<float>(0.5 * spec.diameter_m)),
      colour_(Eigen::Vector3d(spec.red, spec.green, spec.blue).cast<float>()) {
  if (spec.count == 0) return;
  const Vector3f middle = 0.5f * (landmarks[62] + landmarks[66]);
  std::vector<Dot> inner;
  for (int i = 0; i < 8; ++i) {
    const Vector3f in = lip_point(landmarks, 8 + i), out = lip_point(landmarks, i);
    const bool corner = i == 0 || i == 4;
    const Vector3f way = out - in, outward = (way + 0.25f * (out - middle)).normalized();
    // A dot across the corner would be torn by an opening mouth: it goes beside it.
    const Vector3f target =
        corner ? Vector3f(out + 1.5f * radius_m_ * outward) : Vector3f(in + kInnerShare * way);
    inner.push_back(touch(skin, target));
    const Vector3f from = inner.back().centre_m;
    const float apart = std::max((out - from).norm(), 2 * kLeastDiameters * radius_m_);
    dots_.push_back(touch(skin, from + apart * outward));
  }
  if (spec.count == 16) dots_.insert(dots_.end(), inner.begin(), inner.end());
}

Vector3f LipPaint::over(const Vector3f& place_m, const Vector3f& bare) const {
  float cover = 0.0f;
  for (const Dot& dot : dots_) {
    const float distance = (place_m - dot.centre_m).norm();
    cover = std::max(cover, 1 - smooth_step(radius_m_ - kRimM, radius_m_ + kRimM, distance));
  }
  return bare + cover * (colour_ - bare);
}

}  // namespace semblance
