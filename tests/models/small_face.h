// A small shape with all kinds of fields, for tests.
#pragma once

#include <cmath>

#include "semblance/models/morph_model.h"

namespace semblance::testing {

/// A sheet of 5 x 4 vertices with one identity and three expression parameters. "bend" has two
/// fields whose weights are sin and 1 - cos, like a rotation.
inline MorphShape small_face() {
  constexpr int columns = 5, rows = 4;
  auto mesh = std::make_shared<Mesh>();
  mesh->positions_m.resize(columns * rows, 3);
  for (int i = 0; i < columns * rows; ++i) {
    mesh->positions_m.row(i) << 0.02 * (i % columns), 0.03 * (i / columns), 0.001 * i * i;
  }
  mesh->triangles.resize(2 * (columns - 1) * (rows - 1), 3);
  int triangle = 0;
  for (int y = 0; y + 1 < rows; ++y) {
    for (int x = 0; x + 1 < columns; ++x) {
      const int a = y * columns + x;
      mesh->triangles.row(triangle++) << a, a + 1, a + columns;
      mesh->triangles.row(triangle++) << a + 1, a + columns + 1, a + columns;
    }
  }
  MorphShape shape;
  shape.parameters = {scalar_block("width", "1", -3, 3, 0, 1, "identity"),
                      scalar_block("bend", "rad", 0, 1, 0, 0.3, "expression"),
                      scalar_block("point", "1", 0, 1, 0, 0.3, "expression"),
                      scalar_block("gaps", "1", -1, 1, 0, 0.3, "expression")};
  shape.identity_count = 1;
  PointsF widen = PointsF::Zero(columns * rows, 3);
  widen.col(0) = 0.1f * mesh->positions_m.col(0).cast<float>();
  shape.fields.push_back(make_field(0, widen));
  PointsF sine = PointsF::Zero(columns * rows, 3), cosine = sine;
  sine.bottomRows(7).col(2).setConstant(0.01f);
  cosine.bottomRows(7).col(1).setConstant(-0.01f);
  shape.fields.push_back(make_field(1, sine));
  shape.fields.back().weight = [](double t) { return Weight{std::sin(t), std::cos(t)}; };
  shape.fields.push_back(make_field(1, cosine));
  shape.fields.back().weight = [](double t) { return Weight{1 - std::cos(t), std::sin(t)}; };
  PointsF point = PointsF::Zero(columns * rows, 3);
  point.row(3) << 0.004f, -0.005f, 0.006f;
  shape.fields.push_back(make_field(2, point));
  PointsF gaps = PointsF::Zero(columns * rows, 3);
  for (int i : {0, 2, 9, 19}) gaps.row(i) << 0.001f * i, 0.002f, -0.003f;
  shape.fields.push_back(make_field(3, gaps));
  shape.mesh = mesh;
  shape.landmarks = {{"corner", 0, {1, 0, 0}}, {"middle", 5, {0.2f, 0.3f, 0.5f}}};
  shape.part.assign(columns * rows, static_cast<std::uint8_t>(FacePart::skin));
  return shape;
}

}  // namespace semblance::testing
