#include "semblance/cost/photometric.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "photometric_kernel.h"
#include "semblance/core/errors.h"
#include "shaded_vertices.h"

namespace semblance {

int matching_texture_level(const Synthesis& synthesis, const Appearance& appearance,
                           const SurfaceTopology& topology) {
  const SceneObject& object = synthesis.scene.objects.front();
  const AlbedoPyramid::Level& finest = appearance.albedo().levels.front();
  double texels = 0.0, pixels = 0.0;
  constexpr std::size_t kStride = 7;
  for (std::size_t i = 0; i < synthesis.pixels.size(); i += kStride) {
    const auto& corner = topology.triangles[synthesis.pixels.triangle[i]];
    const auto area = [&](auto coordinate) {
      const Eigen::Vector2d a = coordinate(corner[1]) - coordinate(corner[0]);
      const Eigen::Vector2d b = coordinate(corner[2]) - coordinate(corner[0]);
      return std::abs(a.x() * b.y() - a.y() * b.x());
    };
    texels += area([&](int v) -> Eigen::Vector2d {
      return {object.mesh->uvs(v, 0) * finest.width, object.mesh->uvs(v, 1) * finest.height};
    });
    pixels += area([&](int v) -> Eigen::Vector2d {
      return {synthesis.projected[3 * v], synthesis.projected[3 * v + 1]};
    });
  }
  if (!(pixels > 0.0) || !(texels > 0.0)) return 0;
  const int level = static_cast<int>(std::lround(0.5 * std::log2(texels / pixels)));
  return std::clamp(level, 0, static_cast<int>(appearance.albedo().levels.size()) - 1);
}

PhotometricCost::PhotometricCost(const ObservationLevel* observation, const Appearance* appearance,
                                 const SurfaceTopology* topology,
                                 const std::vector<float>* triangle_weight,
                                 const PhotometricOptions& options)
    : observation_(observation),
      appearance_(appearance),
      topology_(topology),
      triangle_weight_(triangle_weight),
      options_(options) {}

namespace {

/// Vertices are written to `vertices`, which must outlive the result.
detail::ShadeInput shade_input(const Synthesis& synthesis, const AlbedoPyramid::Level& texture,
                               const SurfaceTopology& topology,
                               const std::vector<float>& triangle_weight,
                               std::vector<detail::VertexRecord>& vertices) {
  if (synthesis.scene.objects.size() != 1) {
    throw InvalidInput("the photometric cost compares scenes of one object, this one has " +
                       std::to_string(synthesis.scene.objects.size()));
  }
  if (texture.width < 2 || texture.height < 2) {
    throw InvalidInput("the photometric cost needs a texture of at least 2 x 2 texels");
  }
  detail::shade_vertices(synthesis.scene, texture.width, texture.height, vertices);
  const VisiblePixels& seen = synthesis.pixels;
  return {seen.size(),
          seen.triangle.data(),
          seen.b1.data(),
          seen.b2.data(),
          topology.triangles.front().data(),
          vertices.data(),
          triangle_weight.data(),
          texture.texels.data(),
          texture.width,
          texture.height};
}

}  // namespace

double PhotometricCost::shade(const Synthesis& synthesis, ShadedPixels& out) const {
  std::vector<detail::VertexRecord> vertices;
  const detail::ShadeInput input =
      shade_input(synthesis, appearance_->albedo().levels[options_.texture_level], *topology_,
                  *triangle_weight_, vertices);
  out.colour.resize(4 * synthesis.pixels.size());
  return detail::photometric_kernel().shade(input, out.colour.data());
}

double PhotometricCost::evaluate(const Synthesis& synthesis, SurfaceEquations* surface,
                                 NormalEquations* direct) const {
  (void)direct;
  constexpr double kNothingSeen = std::numeric_limits<double>::infinity();
  const VisiblePixels& seen = synthesis.pixels;
  if (seen.size() == 0) return kNothingSeen;
  // Kept between calls: fresh pages would cost as much as the work.
  thread_local std::vector<detail::VertexRecord> vertices;
  thread_local ShadedPixels shaded;
  const detail::ShadeInput shading =
      shade_input(synthesis, appearance_->albedo().levels[options_.texture_level], *topology_,
                  *triangle_weight_, vertices);
  const detail::CompareInput input{
      seen.pixel.data(), observation_->encoded.data(), observation_->gradient.data(),
      static_cast<float>(1.0 / (options_.sigma * options_.sigma)),
      static_cast<float>(1.0 / (options_.robust_width * options_.robust_width))};
  const detail::Kernel& kernel = detail::photometric_kernel();
  const double reference = options_.reference_pixels > 0.0 ? options_.reference_pixels
                                                           : static_cast<double>(seen.size());
  const auto scale = [&](double weight) {
    return reference / (weight * options_.correlation_area_px);
  };
  if (surface == nullptr) {
    const detail::CompareSums sums = kernel.compare(shading, input);
    return sums.weight > 0.0 ? scale(sums.weight) * sums.cost : kNothingSeen;
  }
  shaded.colour.resize(4 * seen.size());
  const double weight = kernel.shade(shading, shaded.colour.data());
  if (!(weight > 0.0)) return kNothingSeen;
  return scale(weight) * kernel.linearize(shading, input, shaded.colour.data(),
                                          static_cast<float>(scale(weight)),
                                          surface->accumulators(seen.triangle));
}

namespace {

/// Sums for a weighted correlation coefficient.
struct Correlation {
  double w = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;

  void add(double weight, double x, double y) {
    w += weight;
    a += weight * x;
    b += weight * y;
    aa += weight * x * x;
    bb += weight * y * y;
    ab += weight * x * y;
  }
  double value() const {
    if (!(w > 0.0)) return 0.0;
    const double va = aa / w - a / w * (a / w), vb = bb / w - b / w * (b / w);
    return va > 1e-12 && vb > 1e-12 ? (ab / w - a / w * (b / w)) / std::sqrt(va * vb) : 0.0;
  }
};

}  // namespace

PhotometricCost::Statistics PhotometricCost::statistics(const Synthesis& synthesis) const {
  Statistics out;
  const VisiblePixels& seen = synthesis.pixels;
  out.pixels = seen.size();
  out.pixel_weight.assign(seen.size(), 0.0f);
  if (seen.size() == 0) return out;
  ShadedPixels shaded;
  shade(synthesis, shaded);
  double weight_sum = 0.0, inlier_sum = 0.0, square_sum = 0.0;
  Correlation picture, neighbour;
  std::vector<float> magnitudes;
  float previous = 0.0f;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const float* record = observation_->colour(seen.pixel[i]);
    const float* colour = shaded.colour.data() + 4 * i;
    float square = 0.0f, residual = 0.0f, synthetic = 0.0f, observed = 0.0f;
    for (int c = 0; c < 3; ++c) {
      const float r = colour[c] - record[c];
      square += r * r;
      residual += r;
      synthetic += colour[c];
      observed += record[c];
    }
    const float weight = colour[3];
    const double s = square / (options_.sigma * options_.sigma);
    const double q = 1.0 / (1.0 + s / (options_.robust_width * options_.robust_width));
    out.pixel_weight[i] = static_cast<float>(q * q);
    if (weight > 0.0f) {
      weight_sum += weight;
      square_sum += weight * square / 3.0;
      if (s < options_.robust_width * options_.robust_width) inlier_sum += weight;
      picture.add(weight, synthetic, observed);
      magnitudes.push_back(std::sqrt(square / 3.0f));
      if (i > 0 && seen.pixel[i] == seen.pixel[i - 1] + 1)
        neighbour.add(weight, previous, residual);
    }
    previous = residual;
  }
  if (!(weight_sum > 0.0)) return out;
  out.rms = std::sqrt(square_sum / weight_sum);
  out.inlier_fraction = inlier_sum / weight_sum;
  out.correlation = picture.value();
  out.lag_correlation = neighbour.value();
  const auto middle = magnitudes.begin() + static_cast<std::ptrdiff_t>(magnitudes.size() / 2);
  std::nth_element(magnitudes.begin(), middle, magnitudes.end());
  // The root mean square of three normal residuals has its median at 0.888 sigma.
  out.sigma = *middle / 0.888;
  return out;
}

}  // namespace semblance
