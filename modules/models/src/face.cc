#include "semblance/models/face.h"

#include "face_expression.h"
#include "face_identity.h"
#include "face_landmarks.h"
#include "face_measure.h"
#include "face_sweep.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

using face::Identity;
using face::Points;

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

}  // namespace

MorphShape make_sweep_face(const FaceResolution& resolution) {
  if (!(resolution.density >= 0.3 && resolution.density <= 6.0)) {
    throw InvalidInput("face density must lie between 0.3 and 6");
  }
  const face::Layout layout = face::make_layout(resolution.density);
  const Identity mean = face::mean_identity();
  const face::Sweep sweep(layout.places);
  const Points neutral = sweep.at(mean);

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

  const auto& table = face::identity_measures();
  for (std::size_t i = 0; i < table.size(); ++i) {
    shape.parameters.push_back(
        scalar_block(table[i].name, "sd", -3.0, 3.0, 0.0, 1.0, table[i].doc));
    const Eigen::Index k = static_cast<Eigen::Index>(i);
    const double step = face::coefficient_per_deviation(k, mean);
    Identity up = mean, down = mean;
    up[k] += step;
    down[k] -= step;
    const Points change = 0.5 * (sweep.at(up) - sweep.at(down));
    shape.fields.push_back(linear_field(static_cast<int>(i), change));
  }
  shape.identity_count = static_cast<int>(table.size());
  face::Expressions expressions = face::make_expressions(layout.places, neutral, mean);
  for (MorphField& field : expressions.fields) {
    field.parameter += shape.identity_count;
    shape.fields.push_back(std::move(field));
  }
  for (auto& block : expressions.parameters) shape.parameters.push_back(std::move(block));

  shape.landmarks = face::ibug_landmarks(layout);
  shape.mesh = std::move(mesh);
  return shape;
}

}  // namespace semblance
