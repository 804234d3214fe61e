#include "semblance/cost/light.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "semblance/core/parallel.h"
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

LightEquations::LightEquations() {
  normal_.setZero();
  right_.setZero();
}

void LightEquations::add(const std::array<float, 9>& basis, const float* albedo,
                         const float* observed, double weight) {
  const Eigen::Array<double, 9, 1> y =
      Eigen::Map<const Eigen::Array<float, 9, 1>>(basis.data()).cast<double>();
  Eigen::Array<double, kProducts, 1> products;
  for (int j = 0, p = 0; j < 9; ++j) {
    for (int i = j; i < 9; ++i) products[p++] = y[i] * y[j];
  }
  for (int c = 0; c < 3; ++c) {
    const double colour = double{albedo[c]} * albedo[c];
    const double seen = double{observed[c]} * observed[c];
    // d(encoded) = d(linear) / (2 encoded): weighting undoes the encoding to first order.
    const double w = weight / std::max(4.0 * seen, 0.02);
    normal_.col(c) += (w * colour * colour) * products;
    right_.col(c) += (w * colour * seen) * y;
  }
}

LightEquations& LightEquations::operator+=(const LightEquations& other) {
  normal_ += other.normal_;
  right_ += other.right_;
  return *this;
}

ShLight LightEquations::solve(const ShLight& before, double pull, int order) const {
  ShLight light = before;
  for (int c = 0; c < 3; ++c) {
    Eigen::Matrix<double, 9, 9> system;
    for (int j = 0, p = 0; j < 9; ++j) {
      for (int i = j; i < 9; ++i) system(i, j) = system(j, i) = normal_(p++, c);
    }
    Eigen::Matrix<double, 9, 1> last;
    for (int k = 0; k < 9; ++k) last[k] = before.coefficients[k][c];
    const double data = std::max(system(0, 0), 1e-9);
    Eigen::Matrix<double, 9, 1> hold = Eigen::Matrix<double, 9, 1>::Constant(pull * data);
    constexpr double kFixed = 1e6;
    if (order < 2) hold.tail<5>().setConstant(kFixed * data);
    system.diagonal() += hold;
    const Eigen::Matrix<double, 9, 1> next =
        system.ldlt().solve(right_.col(c).matrix() + hold.cwiseProduct(last));
    if (!next.allFinite()) continue;
    for (int k = 0; k < 9; ++k) light.coefficients[k][c] = static_cast<float>(next[k]);
  }
  return light;
}

ShLight estimate_light(const Synthesis& synthesis, const ObservationLevel& observation,
                       const Appearance& appearance, const SurfaceTopology& topology,
                       const std::vector<float>& pixel_weight, const LightOptions& options) {
  const SceneObject& object = synthesis.scene.objects.front();
  const AlbedoPyramid::Level& texture = appearance.albedo().levels.front();
  const VisiblePixels& seen = synthesis.pixels;
  const auto add_pixel = [&](std::size_t i, LightEquations& equations) {
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
    equations.add(sh_basis(n[0], n[1], n[2]), texel, observation.colour(seen.pixel[i]),
                  pixel_weight[i] * texel[3]);
  };
  // Blocks of a fixed size, summed in their order: the light is the same for any thread count.
  constexpr std::size_t kBlock = 1024;
  const auto stride = static_cast<std::size_t>(options.stride);
  const std::size_t used = (seen.size() + stride - 1) / stride;
  std::vector<LightEquations> parts((used + kBlock - 1) / kBlock);
  parallel_for(parts.size(), [&](std::size_t part) {
    const std::size_t end = std::min(used, (part + 1) * kBlock);
    for (std::size_t k = part * kBlock; k < end; ++k) add_pixel(k * stride, parts[part]);
  });
  LightEquations sum;
  for (const LightEquations& part : parts) sum += part;
  return sum.solve(synthesis.scene.light, options.pull, options.order);
}

}  // namespace semblance
