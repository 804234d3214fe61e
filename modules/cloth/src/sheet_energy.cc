#include "semblance/cloth/sheet_energy.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "semblance/core/parallel.h"

namespace semblance {
namespace {

constexpr int chunk_rows = 2048;
constexpr double tiny_length = 1e-12;

bool is_bending(StrainKind kind) {
  return kind == StrainKind::bend_warp || kind == StrainKind::bend_weft ||
         kind == StrainKind::twist;
}

/// How much stays of the curvature that may be negative. A fifth less than all of it keeps modes
/// positive that are about to buckle.
double kept_curvature(HessianKind kind) {
  switch (kind) {
    case HessianKind::exact:
      return 1.0;
    case HessianKind::nearly_exact:
      return 0.8;
    case HessianKind::convex:
      break;
  }
  return 0.0;
}

Eigen::Matrix3d row_hessian(double along, double across, const Eigen::Vector3d& direction) {
  return across * Eigen::Matrix3d::Identity() +
         (along - across) * direction * direction.transpose();
}

void store_symmetric(const Eigen::Matrix3d& h, std::array<float, 8>& out) {
  out = {static_cast<float>(h(0, 0)),
         static_cast<float>(h(0, 1)),
         static_cast<float>(h(0, 2)),
         static_cast<float>(h(1, 1)),
         static_cast<float>(h(1, 2)),
         static_cast<float>(h(2, 2)),
         0.0f,
         0.0f};
}

/// Angle between warp and weft less a right angle, with derivatives in both.
struct ShearAngle {
  double angle;
  Eigen::Vector3d by_warp, by_weft;
  double sine, slope, bend;  // of the angle in the sine
  Eigen::Vector3d a, b;      // unit vectors
  double warp_length, weft_length;
  Eigen::Vector3d sine_by_warp, sine_by_weft;

  ShearAngle(const Eigen::Vector3d& warp, const Eigen::Vector3d& weft)
      : warp_length(std::max(warp.norm(), tiny_length)),
        weft_length(std::max(weft.norm(), tiny_length)) {
    a = warp / warp_length;
    b = weft / weft_length;
    // Beyond 82 degrees yarns lie on each other: the slope is held there.
    sine = std::clamp(a.dot(b), -0.99, 0.99);
    const double cosine2 = 1.0 - sine * sine;
    slope = 1.0 / std::sqrt(cosine2);
    bend = sine * slope / cosine2;
    angle = std::asin(sine);
    sine_by_warp = (b - sine * a) / warp_length;
    sine_by_weft = (a - sine * b) / weft_length;
    by_warp = slope * sine_by_warp;
    by_weft = slope * sine_by_weft;
  }

  Eigen::Matrix3d sine_by_warp_warp() const {
    const Eigen::Vector3d t = b - sine * a;
    return -(a * t.transpose() + t * a.transpose() +
             sine * (Eigen::Matrix3d::Identity() - a * a.transpose())) /
           (warp_length * warp_length);
  }
  Eigen::Matrix3d sine_by_weft_weft() const {
    const Eigen::Vector3d t = a - sine * b;
    return -(b * t.transpose() + t * b.transpose() +
             sine * (Eigen::Matrix3d::Identity() - b * b.transpose())) /
           (weft_length * weft_length);
  }
  Eigen::Matrix3d sine_by_warp_weft() const {
    return (Eigen::Matrix3d::Identity() - b * b.transpose() - a * a.transpose() +
            sine * a * b.transpose()) /
           (warp_length * weft_length);
  }
};

}  // namespace

struct SheetEnergy::RowSlots {
  double kept;  // part of the curvature of lengths and angles that may be negative
  std::vector<std::array<double, 3>> gradient;
  StrainHessian* hessian;

  double damped(double curvature) const { return curvature < 0.0 ? kept * curvature : curvature; }
  void set_gradient(int e, const Eigen::Vector3d& g) {
    if (!gradient.empty()) gradient[e] = {g[0], g[1], g[2]};
  }
};

SheetEnergy::SheetEnergy(const Sheet& sheet, Fabric fabric, const SheetModel& model,
                         const std::vector<bool>& fixed)
    : fabric_(std::move(fabric)),
      model_(model),
      deformation_(deformation_of(sheet, model.bending, fixed)),
      triangles_(sheet.triangles),
      twist_(twist_response(fabric_)) {
  const double wave = 2.0 * std::numbers::pi / model.buckling_wavelength_m;
  for (int k = 0; k < 2; ++k) {
    buckling_load_n_m_[k] = fabric_.bending[k].elastic.evaluate(0.0).slope * wave * wave;
  }
  if (model.internal_friction == InternalFriction::monotone) {
    for (ModeResponse* mode : {&fabric_.tension[0], &fabric_.tension[1], &fabric_.bending[0],
                               &fabric_.bending[1], &fabric_.shear, &twist_}) {
      mode->elastic = loading_curve(*mode);
    }
  }
  vertex_begin_.assign(sheet.vertex_count() + 1, 0);
  for (int e = 0; e < deformation_.row_count(); ++e) {
    for (const StrainEntry& entry : deformation_.row(e)) ++vertex_begin_[entry.vertex + 1];
  }
  for (Eigen::Index v = 0; v < sheet.vertex_count(); ++v) {
    vertex_begin_[v + 1] += vertex_begin_[v];
  }
  vertex_rows_.resize(vertex_begin_.back());
  std::vector<int> next(vertex_begin_.begin(), vertex_begin_.end() - 1);
  for (int e = 0; e < deformation_.row_count(); ++e) {
    for (const StrainEntry& entry : deformation_.row(e)) {
      vertex_rows_[next[entry.vertex]++] = {e, entry.coefficient};
    }
  }
}

const ModeResponse& SheetEnergy::response(StrainKind kind) const {
  switch (kind) {
    case StrainKind::warp:
      return fabric_.tension[0];
    case StrainKind::weft:
      return fabric_.tension[1];
    case StrainKind::shear_warp:
    case StrainKind::shear_weft:
      return fabric_.shear;
    case StrainKind::bend_warp:
    case StrainKind::interlaced:
      return fabric_.bending[0];
    case StrainKind::bend_weft:
      return fabric_.bending[1];
    case StrainKind::twist:
      break;
  }
  return twist_;
}

/// Energy per area over the length of the row's vector.
LawPoint SheetEnergy::length_law(StrainKind kind, int e, double length) const {
  switch (kind) {
    case StrainKind::warp:
    case StrainKind::weft: {
      const int yarn = kind == StrainKind::warp ? 0 : 1;
      return tension_response(fabric_.tension[yarn].elastic, model_.compression,
                              buckling_load_n_m_[yarn], length - 1.0);
    }
    case StrainKind::interlaced: {
      const double bending = 0.5 * (fabric_.bending[0].elastic.evaluate(0.0).slope +
                                    fabric_.bending[1].elastic.evaluate(0.0).slope);
      const double stretch = fabric_.tension[0].elastic.evaluate(0.0).slope;
      return interlaced_response(bending, stretch, deformation_.length_m(e), length);
    }
    default:
      return odd_response(response(kind).elastic, length);
  }
}

double SheetEnergy::scalar_strain(const Points& positions_m, StrainKind kind, int e) const {
  if (kind == StrainKind::shear_warp) {
    const int pair = e - deformation_.first(StrainKind::shear_warp);
    const int f = deformation_.first(StrainKind::shear_weft) + pair;
    return ShearAngle(deformation_.strain(positions_m, e), deformation_.strain(positions_m, f))
        .angle;
  }
  const Eigen::Vector3d d = deformation_.strain(positions_m, e);
  return is_bending(kind) ? normal_[e].dot(d) : d.norm() - 1.0;
}

double SheetEnergy::evaluate_row(const Points& positions_m, StrainKind strain, int e,
                                 RowSlots& slots) const {
  const Eigen::Vector3d d = deformation_.strain(positions_m, e);
  const double length = d.norm(), area = deformation_.area_m2(e);
  LawPoint law = length_law(strain, e, length);
  LawPoint lossy;
  if (!dissipation_.empty() && strain != StrainKind::interlaced) {
    if (is_bending(strain)) {
      lossy = dissipation_[e].evaluate(normal_[e].dot(d));
    } else {
      const LawPoint along = dissipation_[e].evaluate(length - 1.0);
      law.energy += along.energy;
      law.force += along.force;
      law.stiffness += along.stiffness;
    }
  }
  const Eigen::Vector3d direction =
      length > tiny_length ? Eigen::Vector3d(d / length) : Eigen::Vector3d::Zero();
  Eigen::Vector3d g = law.force * direction;
  if (lossy.stiffness != 0.0 || lossy.force != 0.0) g += lossy.force * normal_[e];
  slots.set_gradient(e, area * g);
  if (slots.hessian != nullptr) {
    // Across the direction the force turns with it. Compression makes that negative.
    const double across = slots.damped(length > tiny_length ? law.force / length : law.stiffness);
    Eigen::Matrix3d h = row_hessian(slots.damped(law.stiffness), across, direction);
    if (lossy.stiffness != 0.0) h += lossy.stiffness * normal_[e] * normal_[e].transpose();
    store_symmetric(area * h, slots.hessian->rows[e]);
  }
  return area * (law.energy + lossy.energy);
}

double SheetEnergy::evaluate_shear(const Points& positions_m, int pair, RowSlots& slots) const {
  const int e = deformation_.first(StrainKind::shear_warp) + pair;
  const int f = deformation_.first(StrainKind::shear_weft) + pair;
  const double area = deformation_.area_m2(e);
  const ShearAngle shear(deformation_.strain(positions_m, e), deformation_.strain(positions_m, f));
  LawPoint law = odd_response(fabric_.shear.elastic, shear.angle);
  if (!dissipation_.empty()) {
    const LawPoint lossy = dissipation_[e].evaluate(shear.angle);
    law.energy += lossy.energy;
    law.force += lossy.force;
    law.stiffness += lossy.stiffness;
  }
  slots.set_gradient(e, area * law.force * shear.by_warp);
  slots.set_gradient(f, area * law.force * shear.by_weft);
  if (slots.hessian != nullptr) {
    const double outer =
        law.stiffness * shear.slope * shear.slope + slots.kept * law.force * shear.bend;
    const double inner = slots.kept * law.force * shear.slope;
    const auto& by_a = shear.sine_by_warp;
    const auto& by_b = shear.sine_by_weft;
    store_symmetric(area * (outer * by_a * by_a.transpose() + inner * shear.sine_by_warp_warp()),
                    slots.hessian->rows[e]);
    store_symmetric(area * (outer * by_b * by_b.transpose() + inner * shear.sine_by_weft_weft()),
                    slots.hessian->rows[f]);
    const Eigen::Matrix3d mixed =
        area * (outer * by_a * by_b.transpose() + inner * shear.sine_by_warp_weft());
    std::array<float, 12>& out = slots.hessian->shear[pair];
    for (int c = 0; c < 3; ++c) {
      for (int r = 0; r < 3; ++r) out[4 * c + r] = static_cast<float>(mixed(r, c));
      out[4 * c + 3] = 0.0f;
    }
  }
  return area * law.energy;
}

double SheetEnergy::evaluate(const Points& positions_m, HessianKind kind, Points* gradient,
                             StrainHessian* hessian) const {
  RowSlots slots{kept_curvature(kind), {}, hessian};
  if (gradient != nullptr) slots.gradient.resize(deformation_.row_count());
  const int pairs =
      deformation_.last(StrainKind::shear_warp) - deformation_.first(StrainKind::shear_warp);
  if (hessian != nullptr) {
    hessian->rows.resize(deformation_.row_count());
    hessian->shear.resize(pairs);
  }
  struct Chunk {
    StrainKind kind;
    int begin, end;
  };
  std::vector<Chunk> chunks;
  for (int k = 0; k < strain_kind_count; ++k) {
    const StrainKind strain = static_cast<StrainKind>(k);
    if (strain == StrainKind::shear_weft) continue;
    for (int e = deformation_.first(strain); e < deformation_.last(strain); e += chunk_rows) {
      chunks.push_back({strain, e, std::min(e + chunk_rows, deformation_.last(strain))});
    }
  }
  std::vector<double> energies(chunks.size(), 0.0);
  parallel_for(chunks.size(), [&](std::size_t c) {
    double sum = 0.0;
    for (int e = chunks[c].begin; e < chunks[c].end; ++e) {
      sum +=
          chunks[c].kind == StrainKind::shear_warp
              ? evaluate_shear(positions_m, e - deformation_.first(StrainKind::shear_warp), slots)
              : evaluate_row(positions_m, chunks[c].kind, e, slots);
    }
    energies[c] = sum;
  });
  if (gradient != nullptr) gather_gradient(slots, *gradient);
  double total = 0.0;
  for (const double e : energies) total += e;
  return total;
}

void SheetEnergy::gather_gradient(const RowSlots& slots, Points& gradient) const {
  const int vertices = static_cast<int>(vertex_begin_.size()) - 1;
  gradient.resize(vertices, 3);
  const int chunks = (vertices + chunk_rows - 1) / chunk_rows;
  parallel_for(chunks, [&](std::size_t c) {
    const int end = std::min(vertices, (static_cast<int>(c) + 1) * chunk_rows);
    for (int v = static_cast<int>(c) * chunk_rows; v < end; ++v) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (int k = vertex_begin_[v]; k < vertex_begin_[v + 1]; ++k) {
        const auto& g = slots.gradient[vertex_rows_[k].vertex];
        sum += vertex_rows_[k].coefficient * Eigen::Vector3d(g[0], g[1], g[2]);
      }
      gradient.row(v) = sum;
    }
  });
}

void SheetEnergy::resist_lengthening(const Points& from, const Points& to, Points& gradient,
                                     StrainHessian& hessian) const {
  RowSlots slots{kept_curvature(HessianKind::convex), {}, &hessian};
  slots.gradient.assign(deformation_.row_count(), {});
  each_row({StrainKind::warp, StrainKind::weft}, [&](StrainKind kind, int e) {
    const Eigen::Vector3d before = deformation_.strain(from, e);
    const Eigen::Vector3d now = deformation_.strain(to, e);
    const double length = std::max(before.norm(), tiny_length);
    const double foreseen = length + before.dot(now - before) / length;
    const double excess = now.norm() - foreseen;
    const LawPoint law = length_law(kind, e, foreseen);
    // Slack yarns too get the stiffness of taut ones: the excess may have made them taut.
    const double taut = response(kind).elastic.evaluate(0.0).slope;
    const double gain = length_law(kind, e, foreseen + excess).force - law.force;
    const double stiffness = std::max({taut, law.stiffness, gain / std::max(excess, tiny_length)});
    const Eigen::Vector3d direction = now / std::max(now.norm(), tiny_length);
    const double area = deformation_.area_m2(e);
    slots.set_gradient(e, area * stiffness * excess * direction);
    store_symmetric(area * row_hessian(stiffness, slots.damped(law.force / length), direction),
                    hessian.rows[e]);
  });
  gather_gradient(slots, gradient);
}

double SheetEnergy::energy(const Points& positions_m) const {
  return evaluate(positions_m, HessianKind::exact, nullptr, nullptr);
}

double SheetEnergy::gradient(const Points& positions_m, Points& gradient) const {
  return evaluate(positions_m, HessianKind::exact, &gradient, nullptr);
}

double SheetEnergy::hessian(const Points& positions_m, HessianKind kind, Points& gradient,
                            StrainHessian& hessian) const {
  return evaluate(positions_m, kind, &gradient, &hessian);
}

void SheetEnergy::each_row(std::initializer_list<StrainKind> kinds,
                           const std::function<void(StrainKind, int)>& body) const {
  for (const StrainKind kind : kinds) {
    const int first = deformation_.first(kind), count = deformation_.last(kind) - first;
    parallel_for((count + chunk_rows - 1) / chunk_rows, [&](std::size_t c) {
      const int begin = static_cast<int>(c) * chunk_rows;
      for (int k = begin; k < std::min(count, begin + chunk_rows); ++k) body(kind, first + k);
    });
  }
}

void SheetEnergy::each_lossy_row(const std::function<void(StrainKind, int)>& body) const {
  each_row({StrainKind::warp, StrainKind::weft, StrainKind::shear_warp, StrainKind::bend_warp,
            StrainKind::bend_weft, StrainKind::twist},
           body);
}

SheetMemory SheetEnergy::memory_at(const Points& positions_m) {
  set_normals(positions_m);
  SheetMemory memory;
  memory.anchor.assign(deformation_.row_count(), 0.0);
  each_lossy_row(
      [&](StrainKind kind, int e) { memory.anchor[e] = scalar_strain(positions_m, kind, e); });
  memory.previous = memory.anchor;
  return memory;
}

void SheetEnergy::begin_step(const Points& positions_m, const SheetMemory& memory, double step_s) {
  set_normals(positions_m);
  dissipation_.assign(deformation_.row_count(), {});
  each_lossy_row([&](StrainKind kind, int e) {
    const ModeResponse& mode = response(kind);
    Dissipation& lossy = dissipation_[e];
    lossy.anchor = memory.anchor[e];
    lossy.previous = memory.previous[e];
    const bool yarn = kind == StrainKind::warp || kind == StrainKind::weft;
    // Yarns that are pushed together buckle and do not rub: friction is measured in tension.
    const double size = yarn ? std::max(0.0, lossy.previous) : std::abs(lossy.previous);
    if (model_.internal_friction == InternalFriction::incremental) {
      lossy.reach = mode.reversal;
      lossy.threshold = mode.friction.value(size);
    }
    if (std::isfinite(step_s)) {
      lossy.damping = mode.viscosity_s * mode.elastic.evaluate(size).slope / step_s;
    }
  });
}

void SheetEnergy::end_step(const Points& positions_m, SheetMemory& memory) const {
  each_lossy_row([&](StrainKind kind, int e) {
    const double now = scalar_strain(positions_m, kind, e);
    memory.anchor[e] = dissipation_[e].slipped_anchor(now);
    memory.previous[e] = now;
  });
}

/// Bending has a sign, by the side that the sheet is bent to: that of the row's own normal.
void SheetEnergy::set_normals(const Points& positions_m) {
  Points vertex_normals = Points::Zero(positions_m.rows(), 3);
  for (int t = 0; t < triangles_.rows(); ++t) {
    const Eigen::RowVector3d a = positions_m.row(triangles_(t, 0));
    const Eigen::RowVector3d normal =
        (positions_m.row(triangles_(t, 1)) - a).cross(positions_m.row(triangles_(t, 2)) - a);
    for (int k = 0; k < 3; ++k) vertex_normals.row(triangles_(t, k)) += normal;
  }
  normal_.resize(deformation_.row_count());
  each_lossy_row([&](StrainKind kind, int e) {
    if (!is_bending(kind)) return;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const StrainEntry& entry : deformation_.row(e)) sum += vertex_normals.row(entry.vertex);
    normal_[e] = sum.normalized();
  });
}

std::vector<double> SheetEnergy::elongations(const Points& positions_m) const {
  std::vector<double> out(deformation_.last(StrainKind::weft));
  for (std::size_t e = 0; e < out.size(); ++e) {
    out[e] = deformation_.strain(positions_m, static_cast<int>(e)).norm() - 1.0;
  }
  return out;
}

void SheetEnergy::begin_elastic() {
  dissipation_.clear();
  normal_.clear();
}

}  // namespace semblance
