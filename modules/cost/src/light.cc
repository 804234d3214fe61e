#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "semblance/cost/photometric.h"
#include "shaded_vertices.h"

namespace semblance {

namespace detail {

void shade_vertices(const Scene& scene, int texture_width, int texture_height,
                    std::vector<VertexRecord>& out) {
  const SceneObject& object = scene.objects.front();
  const auto count = static_cast<std::size_t>(object.positions_m.rows());
  out.resize(count);
  LightInput input{count, object.normals.data(), object.mesh->uvs.data(),
                   {},    texture_width,         texture_height};
  for (int k = 0; k < 9; ++k) {
    for (int c = 0; c < 3; ++c) input.coefficients[k][c] = scene.light.coefficients[k][c];
  }
  photometric_kernel().light_vertices(input, out.data());
}

}  // namespace detail

ShLight estimate_light(const Synthesis& synthesis, const ObservationLevel& observation,
                       const Appearance& appearance, const SurfaceTopology& topology,
                       const std::vector<float>& pixel_weight, const LightOptions& options) {
  const SceneObject& object = synthesis.scene.objects.front();
  const AlbedoPyramid::Level& texture = appearance.albedo().levels.front();
  using Matrix9 = Eigen::Matrix<double, 9, 9>;
  using Vector9 = Eigen::Matrix<double, 9, 1>;
  std::array<Matrix9, 3> normal;
  std::array<Vector9, 3> right;
  for (int c = 0; c < 3; ++c) {
    normal[c].setZero();
    right[c].setZero();
  }
  const VisiblePixels& seen = synthesis.pixels;
  for (std::size_t i = 0; i < seen.size(); i += static_cast<std::size_t>(options.stride)) {
    const auto& corner = topology.triangles[seen.triangle[i]];
    const float b1 = seen.b1[i], b2 = seen.b2[i], b0 = 1.0f - b1 - b2;
    const Eigen::RowVector3f n =
        (b0 * object.normals.row(corner[0]) + b1 * object.normals.row(corner[1]) +
         b2 * object.normals.row(corner[2]))
            .normalized();
    const Eigen::RowVector2f uv = b0 * object.mesh->uvs.row(corner[0]) +
                                  b1 * object.mesh->uvs.row(corner[1]) +
                                  b2 * object.mesh->uvs.row(corner[2]);
    const int column = std::clamp(static_cast<int>(uv[0] * static_cast<float>(texture.width)), 0,
                                  texture.width - 1);
    const int row =
        std::clamp(static_cast<int>((1.0f - uv[1]) * static_cast<float>(texture.height)), 0,
                   texture.height - 1);
    const float* texel =
        texture.texels.data() + 4 * (std::size_t{1} * row * texture.width + column);
    const auto basis = sh_basis(n[0], n[1], n[2]);
    Vector9 y;
    for (int k = 0; k < 9; ++k) y[k] = basis[k];
    const float* record = observation.colour(seen.pixel[i]);
    for (int c = 0; c < 3; ++c) {
      const double albedo = texel[c] * texel[c];
      const double observed = record[c] * record[c];
      // d(encoded) = d(linear) / (2 encoded): weighting undoes the encoding to first order.
      const double w = pixel_weight[i] * texel[3] / std::max(4.0 * observed, 0.02);
      const Vector9 a = albedo * y;
      normal[c].selfadjointView<Eigen::Lower>().rankUpdate(a, w);
      right[c] += w * observed * a;
    }
  }
  ShLight light = synthesis.scene.light;
  for (int c = 0; c < 3; ++c) {
    Vector9 before;
    for (int k = 0; k < 9; ++k) before[k] = light.coefficients[k][c];
    const double data = std::max(normal[c](0, 0), 1e-9);
    Vector9 pull = Vector9::Constant(options.pull * data);
    constexpr double kFixed = 1e6;
    if (options.order < 2) pull.tail<5>().setConstant(kFixed * data);
    Matrix9 system = normal[c].selfadjointView<Eigen::Lower>();
    system.diagonal() += pull;
    const Vector9 after = system.ldlt().solve(right[c] + pull.cwiseProduct(before));
    if (!after.allFinite()) continue;
    for (int k = 0; k < 9; ++k) light.coefficients[k][c] = static_cast<float>(after[k]);
  }
  return light;
}

}  // namespace semblance
