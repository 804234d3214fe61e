// A curved, textured sheet that fills the image, moved rigidly and by two displacement fields:
// small enough for differences and smooth enough for derivatives.
#pragma once

#include <cmath>

#include "semblance/cost/appearance.h"
#include "semblance/models/morph_model.h"
#include "semblance/pipeline/synthesis_objective.h"

namespace semblance::testing {

inline MorphShape make_sheet(int cells = 24, double size_m = 0.2) {
  const int n = cells + 1;
  auto mesh = std::make_shared<Mesh>();
  mesh->positions_m.resize(n * n, 3);
  mesh->uvs.resize(n * n, 2);
  mesh->triangles.resize(2 * cells * cells, 3);
  PointsF bulge(n * n, 3), shear(n * n, 3);
  for (int r = 0; r < n; ++r) {
    for (int c = 0; c < n; ++c) {
      const double u = static_cast<double>(c) / cells, v = static_cast<double>(r) / cells;
      const double x = size_m * (u - 0.5), y = size_m * (v - 0.5);
      mesh->positions_m.row(n * r + c) << x, y, -0.5 * (x * x + y * y);
      mesh->uvs.row(n * r + c) << static_cast<float>(u), static_cast<float>(v);
      bulge.row(n * r + c) << 0.0f, 0.0f, static_cast<float>(std::exp(-(x * x + y * y) / 0.002));
      shear.row(n * r + c) << static_cast<float>(y), 0.0f, 0.0f;
    }
  }
  int t = 0;
  for (int r = 0; r < cells; ++r) {
    for (int c = 0; c < cells; ++c) {
      const int a = n * r + c;
      mesh->triangles.row(t++) << a, a + 1, a + n + 1;
      mesh->triangles.row(t++) << a, a + n + 1, a + n;
    }
  }
  MorphShape shape;
  shape.mesh = mesh;
  shape.parameters = {scalar_block("bulge", "m", -0.05, 0.05, 0.0, 0.01, "out of the middle"),
                      scalar_block("shear", "1", -0.5, 0.5, 0.0, 0.1, "x grows with y")};
  shape.fields = {make_field(0, 1.0f * bulge), make_field(1, shear)};
  return shape;
}

/// A smooth pattern of linear albedo on the sheet.
inline Eigen::Vector3f sheet_colour(double u, double v) {
  const auto wave = [](double phase) { return static_cast<float>(0.5 + 0.3 * std::sin(phase)); };
  return {wave(11.0 * u + 3.0 * v), wave(12.0 * v - 2.0 * u + 1.0), wave(9.0 * u - 8.0 * v + 2.0)};
}

/// The sheet in front of a camera, with everything a cost needs.
struct Sheet {
  MorphModel model{make_sheet()};
  SurfaceTopology topology = topology_of(model);
  SynthesisWorkspace workspace{model, topology};
  Camera camera = Camera::centred(64, 56, 180.0);
  Eigen::VectorXd x = model.parameters().initial();  // where the image was taken
  std::vector<float> triangle_weight = std::vector<float>(topology.triangles.size(), 1.0f);
  ShLight light;

  Sheet() { x[6] = -0.25; }

  const Mesh& mesh() const { return *model.shape().mesh; }

  PointsF vertex_colour() const {
    PointsF colour(mesh().vertex_count(), 3);
    for (Eigen::Index i = 0; i < colour.rows(); ++i)
      colour.row(i) = sheet_colour(mesh().uvs(i, 0), mesh().uvs(i, 1)).transpose();
    return colour;
  }
  std::vector<float> confidence(float value) const {
    return std::vector<float>(static_cast<std::size_t>(mesh().vertex_count()), value);
  }
  /// Appearance that already knows the pattern.
  Appearance appearance(int size = 256) const {
    return Appearance(mesh(), size, vertex_colour(), confidence(1.0f));
  }
  SynthesisObjective objective(std::vector<const Cost*> costs) {
    std::vector<int> blocks;
    for (std::size_t b = 0; b < model.parameters().blocks().size(); ++b)
      blocks.push_back(static_cast<int>(b));
    return SynthesisObjective(workspace, x, blocks, light, camera, std::move(costs));
  }
  /// x moved so that the image moves by up to about `pixels`.
  Eigen::VectorXd offset(double pixels, int which) const {
    Eigen::VectorXd step(8);
    const double m = pixels * 0.25 / 180.0;  // metres per pixel at the sheet
    for (int k = 0; k < 8; ++k) step[k] = std::sin(1.0 + 2.3 * k + 1.7 * which);
    step.head<3>() *= 6.0 * m;
    step.segment<3>(3) *= m;
    step[6] *= 4.0 * m;
    step[7] *= 8.0 * m;
    return model.parameters().plus(x, step);
  }
};

}  // namespace semblance::testing
