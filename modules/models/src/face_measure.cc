#include "face_measure.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "face_sweep.h"

namespace semblance::face {
namespace {

Place on_skin(const SkinPoint& point, double side) {
  Place place;
  place.column = point.column;
  place.row = point.row;
  place.side = side;
  return place;
}

double measured(const IdentityMeasure& measure, const Identity& c) {
  Place top{Patch::ear, 1.0}, bottom{Patch::ear, 1.0};
  top.a = bottom.a = 3.0 / 9.0;
  top.b = 0.5 * std::numbers::pi;
  bottom.b = 1.5 * std::numbers::pi;
  Place eye{Patch::eyeball, 1.0}, other{Patch::eyeball, -1.0};
  switch (measure.kind) {
    case MeasureKind::none:
      return 0.0;
    case MeasureKind::breadth: {
      const Points p = sweep({on_skin(measure.a, 1.0)}, c);
      return 2.0 * p(0, 0);
    }
    case MeasureKind::distance: {
      const Points p = sweep({on_skin(measure.a, 1.0), on_skin(measure.b, 1.0)}, c);
      return (p.row(0) - p.row(1)).norm();
    }
    case MeasureKind::height: {
      const Points p = sweep({on_skin(measure.a, 1.0), on_skin(measure.b, 1.0)}, c);
      return std::abs(p(0, 1) - p(1, 1));
    }
    case MeasureKind::eyes: {
      const Points p = sweep({eye, other}, c);
      return (p.row(0) - p.row(1)).norm();
    }
    case MeasureKind::ear: {
      const Points p = sweep({top, bottom}, c);
      return (p.row(0) - p.row(1)).norm();
    }
  }
  return 0.0;
}

}  // namespace

Identity mean_identity() {
  const auto& table = identity_measures();
  const Eigen::Index n = static_cast<Eigen::Index>(table.size());
  Identity c = Identity::Zero(n);
  // Each measure in its turn, as they disturb one another, until none is 0.01 mm off.
  double worst_mm = 1.0;
  for (int round = 0; round < 100 && worst_mm > 0.01; ++round) {
    worst_mm = 0.0;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (table[i].mean_mm == 0.0) continue;
      Identity up = c, down = c;
      up[i] += 0.5;
      down[i] -= 0.5;
      const double missing_mm = table[i].mean_mm - measured(table[i], c);
      worst_mm = std::max(worst_mm, std::abs(missing_mm));
      c[i] += missing_mm / (measured(table[i], up) - measured(table[i], down));
    }
  }
  if (worst_mm > 0.01) throw std::logic_error("the face's mean measures contradict one another");
  return c;
}

double coefficient_per_deviation(Eigen::Index i, const Identity& mean) {
  const IdentityMeasure& measure = identity_measures()[i];
  if (measure.kind == MeasureKind::none) return measure.deviation_mm;
  Identity up = mean, down = mean;
  up[i] += 0.5 * measure.deviation_mm;
  down[i] -= 0.5 * measure.deviation_mm;
  return measure.deviation_mm * measure.deviation_mm /
         (measured(measure, up) - measured(measure, down));
}

}  // namespace semblance::face
