#include "semblance/models/face.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "face_expression.h"
#include "face_identity.h"
#include "face_sweep.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

using namespace face;
using Eigen::Vector3d;

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
  top.b = 0.5 * M_PI;
  bottom.b = 1.5 * M_PI;
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

// Coefficients at which every measure has its published mean, by Newton's method.
Identity mean_identity() {
  const auto& table = identity_measures();
  const Eigen::Index n = static_cast<Eigen::Index>(table.size());
  Identity c = Identity::Zero(n);
  for (int iteration = 0; iteration < 12; ++iteration) {
    for (Eigen::Index i = 0; i < n; ++i) {
      if (table[i].mean_mm == 0.0) continue;
      Identity up = c, down = c;
      up[i] += 0.5;
      down[i] -= 0.5;
      c[i] += (table[i].mean_mm - measured(table[i], c)) /
              (measured(table[i], up) - measured(table[i], down));
    }
  }
  return c;
}

// Coefficient per standard deviation: its measure, or the peak displacement, changes by the
// published deviation.
double coefficient(const IdentityMeasure& measure, const Identity& mean, Eigen::Index i) {
  if (measure.kind == MeasureKind::none) return measure.deviation_mm;
  Identity up = mean, down = mean;
  up[i] += 0.5 * measure.deviation_mm;
  down[i] -= 0.5 * measure.deviation_mm;
  return measure.deviation_mm * measure.deviation_mm / (measured(measure, up) - measured(measure, down));
}

MorphField linear_field(int parameter, const Points& difference_mm) {
  MorphField field;
  field.parameter = parameter;
  for (Eigen::Index v = 0; v < difference_mm.rows(); ++v) {
    if (difference_mm.row(v).norm() > 1e-4) field.vertices.push_back(static_cast<int>(v));
  }
  field.displacement_m.resize(static_cast<Eigen::Index>(field.vertices.size()), 3);
  for (std::size_t k = 0; k < field.vertices.size(); ++k) {
    field.displacement_m.row(static_cast<Eigen::Index>(k)) =
        (1e-3 * difference_mm.row(field.vertices[k])).cast<float>();
  }
  return field;
}

struct LandmarkPlace {
  SkinPoint point;
  double side;
};

std::vector<LandmarkPlace> ibug_places() {
  std::vector<LandmarkPlace> all;
  // Jaw, from the right ear down and up to the left.
  const std::vector<SkinPoint> jaw = {
      {column_ear - 0.2, line_lower_lid + 0.3}, {column_ear - 0.25, line_nose_mid},
      {column_ear - 0.35, line_tip_low + 0.5},  {column_ear - 0.5, line_upper_contact - 0.5},
      {column_zygion + 0.1, line_pogonion},     {column_cheek + 0.2, line_jaw - 0.4},
      {column_outer_eye + 0.1, line_jaw - 0.2}, {column_mouth_corner + 0.3, line_jaw - 0.1},
      {0, line_jaw}};
  for (int i = 0; i <= 16; ++i) all.push_back({jaw[i <= 8 ? i : 16 - i], i < 8 ? -1.0 : i > 8 ? 1.0 : 0.0});
  const double brow = line_brow_top + 0.45;
  const std::vector<SkinPoint> brows = {{column_outer_eye + 0.45, brow + 0.3}, {column_outer_eye - 0.4, brow - 0.1},
                                        {column_pupil + 0.1, brow - 0.05}, {column_mouth_corner + 0.1, brow + 0.1},
                                        {column_inner_eye - 0.5, brow + 0.3}};
  for (int i = 0; i < 10; ++i) all.push_back({brows[i < 5 ? i : 9 - i], i < 5 ? -1.0 : 1.0});
  all.push_back({{0, line_lid_crease}, 0});
  all.push_back({{0, line_cheek_top - 0.1}, 0});
  all.push_back({{0, line_nose_mid}, 0});
  all.push_back({{0, line_ala_top + 0.6}, 0});
  const std::vector<SkinPoint> base = {{column_inner_eye - 0.7, line_subnasale - 0.35}, {column_philtrum + 0.6, line_subnasale - 0.15}, {0, line_subnasale}};
  for (int i = 0; i < 5; ++i) all.push_back({base[i <= 2 ? i : 4 - i], i < 2 ? -1.0 : i > 2 ? 1.0 : 0.0});
  const double third = (column_outer_eye - column_inner_eye) / 3.0;
  const std::vector<SkinPoint> eye = {{column_outer_eye, line_upper_lid}, {column_outer_eye - third, line_upper_lid},
                                      {column_inner_eye + third, line_upper_lid}, {column_inner_eye, line_upper_lid},
                                      {column_inner_eye + third, line_lower_lid}, {column_outer_eye - third, line_lower_lid}};
  for (int i = 0; i < 6; ++i) all.push_back({eye[i], -1.0});
  for (int i : {3, 2, 1, 0, 5, 4}) all.push_back({eye[i], 1.0});
  const std::vector<SkinPoint> upper = {{column_mouth_corner, line_upper_contact}, {column_nostril + 0.6, line_upper_vermilion}, {column_philtrum, line_upper_vermilion}, {0, line_upper_vermilion}};
  for (int i = 0; i < 7; ++i) all.push_back({upper[i <= 3 ? i : 6 - i], i < 3 ? -1.0 : i > 3 ? 1.0 : 0.0});
  const std::vector<SkinPoint> lower = {{column_nostril + 0.6, line_lower_vermilion}, {column_philtrum + 0.3, line_lower_vermilion}, {0, line_lower_vermilion}};
  for (int i = 0; i < 5; ++i) all.push_back({lower[i <= 2 ? i : 4 - i], i < 2 ? 1.0 : i > 2 ? -1.0 : 0.0});
  const std::vector<SkinPoint> inner = {{column_mouth_corner - 0.3, line_upper_contact}, {column_nostril - 0.4, line_upper_contact}, {0, line_upper_contact}};
  for (int i = 0; i < 5; ++i) all.push_back({inner[i <= 2 ? i : 4 - i], i < 2 ? -1.0 : i > 2 ? 1.0 : 0.0});
  const std::vector<SkinPoint> inner_low = {{column_nostril - 0.4, line_lower_contact}, {0, line_lower_contact}};
  for (int i = 0; i < 3; ++i) all.push_back({inner_low[i <= 1 ? i : 2 - i], i < 1 ? 1.0 : i > 1 ? -1.0 : 0.0});
  return all;
}

// The triangle and weights of a skin place, found in the plane of column and row.
ModelLandmark located(const std::string& name, const LandmarkPlace& want, const Layout& layout) {
  const bool lower_edge = want.point.row == line_lower_lid || want.point.row == line_lower_contact;
  const double column = want.side < 0.0 ? -want.point.column : want.point.column;
  const auto plane = [&](int v) {
    const Place& p = layout.places[v];
    // The two rows of a slit share their place in the middle of the gap for outside columns.
    return Eigen::Vector2d(p.side < 0.0 ? -p.column : p.column, p.row);
  };
  ModelLandmark best;
  best.name = name;
  double best_score = -1e9;
  for (std::size_t t = 0; t < layout.triangles.size(); ++t) {
    const Eigen::Vector3i& tri = layout.triangles[t];
    bool skin = true;
    for (int k = 0; k < 3; ++k) skin = skin && layout.places[tri[k]].patch == Patch::skin;
    if (!skin) continue;
    const Eigen::Vector2d a = plane(tri[0]), b = plane(tri[1]), c = plane(tri[2]);
    if (lower_edge != (std::max({a.y(), b.y(), c.y()}) > want.point.row + 1e-9) &&
        (lower_edge || want.point.row == line_upper_lid || want.point.row == line_upper_contact)) {
      continue;
    }
    if (std::min({a.x(), b.x(), c.x()}) > column + 1.0 || std::max({a.x(), b.x(), c.x()}) < column - 1.0) continue;
    Eigen::Matrix2d m;
    m << b - a, c - a;
    if (std::abs(m.determinant()) < 1e-12) continue;
    const Eigen::Vector2d w = m.inverse() * (Eigen::Vector2d(column, want.point.row) - a);
    const std::array<double, 3> weights{1.0 - w.x() - w.y(), w.x(), w.y()};
    const double score = std::min({weights[0], weights[1], weights[2]});
    if (score > best_score) {
      best_score = score;
      best.triangle = static_cast<int>(t);
      double sum = 0.0;
      for (int k = 0; k < 3; ++k) sum += std::max(0.0, weights[k]);
      for (int k = 0; k < 3; ++k) best.barycentric[k] = static_cast<float>(std::max(0.0, weights[k]) / sum);
    }
  }
  return best;
}

}  // namespace

MorphShape make_sweep_face(const FaceResolution& resolution) {
  if (!(resolution.density >= 0.3 && resolution.density <= 6.0)) {
    throw InvalidInput("face density must lie between 0.3 and 6");
  }
  const Layout layout = make_layout(resolution.density);
  const Identity mean = mean_identity();
  const Points neutral = sweep(layout.places, mean);

  MorphShape shape;
  auto mesh = std::make_shared<Mesh>();
  mesh->positions_m = 1e-3 * neutral;
  mesh->triangles.resize(static_cast<Eigen::Index>(layout.triangles.size()), 3);
  for (std::size_t t = 0; t < layout.triangles.size(); ++t) {
    mesh->triangles.row(static_cast<Eigen::Index>(t)) = layout.triangles[t];
  }
  mesh->uvs.resize(static_cast<Eigen::Index>(layout.uvs.size()), 2);
  for (std::size_t v = 0; v < layout.uvs.size(); ++v) {
    mesh->uvs.row(static_cast<Eigen::Index>(v)) = layout.uvs[v];
  }
  shape.part = layout.part;

  const auto& table = identity_measures();
  for (std::size_t i = 0; i < table.size(); ++i) {
    shape.parameters.push_back(scalar_block(table[i].name, "sd", -3.0, 3.0, 0.0, 1.0, table[i].doc));
    const Eigen::Index k = static_cast<Eigen::Index>(i);
    const double step = coefficient(table[i], mean, k);
    Identity up = mean, down = mean;
    up[k] += step;
    down[k] -= step;
    shape.fields.push_back(linear_field(static_cast<int>(i), 0.5 * (sweep(layout.places, up) - sweep(layout.places, down))));
  }
  shape.identity_count = static_cast<int>(table.size());
  Expressions expressions = make_expressions(layout.places, neutral);
  for (MorphField& field : expressions.fields) {
    field.parameter += shape.identity_count;
    shape.fields.push_back(std::move(field));
  }
  for (auto& block : expressions.parameters) shape.parameters.push_back(std::move(block));

  const auto places = ibug_places();
  for (std::size_t i = 0; i < places.size(); ++i) {
    const std::string number = std::to_string(i);
    shape.landmarks.push_back(located("ibug_" + std::string(i < 10 ? "0" : "") + number, places[i], layout));
  }
  shape.mesh = std::move(mesh);
  return shape;
}

}  // namespace semblance
