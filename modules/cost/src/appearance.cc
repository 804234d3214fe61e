#include "semblance/cost/appearance.h"

#include <algorithm>
#include <cmath>

namespace semblance {

namespace {

constexpr float kAnchorWeight = 4.0f;  // seen this well in sum, a texel is final
constexpr float kLeastWeight = 0.05f;  // views worse than this show nothing
constexpr float kDepthTolerance_m = 0.003f;

Eigen::Vector3f corner_mix(const PointsF& rows, const Eigen::RowVector3i& corner, float b1,
                           float b2) {
  return ((1.0f - b1 - b2) * rows.row(corner[0]) + b1 * rows.row(corner[1]) +
          b2 * rows.row(corner[2]))
      .transpose();
}

/// Half the size; colours are averaged by confidence, so that unseen texels do not bleed.
AlbedoPyramid::Level half(const AlbedoPyramid::Level& fine) {
  AlbedoPyramid::Level out;
  out.width = std::max(1, fine.width / 2);
  out.height = std::max(1, fine.height / 2);
  out.texels.resize(std::size_t{4} * out.width * out.height);
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      float sum[4] = {0, 0, 0, 0};
      for (int k = 0; k < 4; ++k) {
        const int fx = std::min(2 * x + k % 2, fine.width - 1),
                  fy = std::min(2 * y + k / 2, fine.height - 1);
        const float* t = fine.texels.data() + 4 * (std::size_t{1} * fy * fine.width + fx);
        const float weight = t[3] + 1e-6f;
        for (int c = 0; c < 3; ++c) sum[c] += weight * t[c];
        sum[3] += weight;
      }
      float* o = out.texels.data() + 4 * (std::size_t{1} * y * out.width + x);
      for (int c = 0; c < 3; ++c) o[c] = sum[c] / sum[3];
      o[3] = 0.25f * sum[3];
    }
  }
  return out;
}

}  // namespace

Appearance::Appearance(const Mesh& mesh, int texture_size, const PointsF& vertex_colour,
                       const std::vector<float>& prior_confidence)
    : atlas_(make_texture_atlas(mesh, texture_size, texture_size)),
      triangles_(mesh.triangles),
      seen_(4 * atlas_.size(), 0.0f) {
  prior_confidence_.resize(atlas_.size());
  for (std::size_t i = 0; i < atlas_.size(); ++i) {
    const auto corner = triangles_.row(atlas_.triangle[i]);
    prior_confidence_[i] = (1.0f - atlas_.b1[i] - atlas_.b2[i]) * prior_confidence[corner[0]] +
                           atlas_.b1[i] * prior_confidence[corner[1]] +
                           atlas_.b2[i] * prior_confidence[corner[2]];
  }
  pyramid_.levels.resize(1);
  AlbedoPyramid::Level& finest = pyramid_.levels.front();
  finest.width = finest.height = texture_size;
  finest.texels.assign(std::size_t{4} * texture_size * texture_size, 0.0f);
  set_prior_colour(vertex_colour);
}

void Appearance::set_prior_colour(const PointsF& vertex_colour) {
  prior_.resize(3 * atlas_.size());
  for (std::size_t i = 0; i < atlas_.size(); ++i) {
    const Eigen::Vector3f colour =
        corner_mix(vertex_colour, triangles_.row(atlas_.triangle[i]), atlas_.b1[i], atlas_.b2[i]);
    for (int c = 0; c < 3; ++c) prior_[3 * i + c] = encode_intensity(colour[c]);
  }
  rebuild();
}

void Appearance::gather(const Image& observed_linear, const SceneObject& object,
                        const Camera& camera, const ShLight& light, const VisiblePixels& pixels,
                        const std::vector<float>& pixel_weight) {
  std::vector<std::int32_t> index_at(static_cast<std::size_t>(camera.width) * camera.height, -1);
  for (std::size_t i = 0; i < pixels.size(); ++i) index_at[pixels.pixel[i]] = static_cast<int>(i);
  const Eigen::Matrix3f rotation =
      camera.camera_from_world.rotation.toRotationMatrix().cast<float>();
  const Eigen::Vector3f translation = camera.camera_from_world.translation_m.cast<float>();
  for (std::size_t i = 0; i < atlas_.size(); ++i) {
    float* seen = seen_.data() + 4 * i;
    if (seen[3] >= kAnchorWeight) continue;
    const Eigen::RowVector3i corner = triangles_.row(atlas_.triangle[i]);
    const Eigen::Vector3f normal =
        corner_mix(object.normals, corner, atlas_.b1[i], atlas_.b2[i]).normalized();
    const Eigen::Vector3f p =
        rotation * corner_mix(object.positions_m, corner, atlas_.b1[i], atlas_.b2[i]) + translation;
    const float cosine = -(rotation * normal).dot(p.normalized());
    if (cosine < 0.2f || p.z() <= 0.0f) continue;
    const float x = static_cast<float>(camera.focal_px.x()) * p.x() / p.z() +
                    static_cast<float>(camera.principal_px.x());
    const float y = static_cast<float>(camera.focal_px.y()) * p.y() / p.z() +
                    static_cast<float>(camera.principal_px.y());
    if (!(x >= 1.0f && y >= 1.0f && x < static_cast<float>(camera.width - 1) &&
          y < static_cast<float>(camera.height - 1)))
      continue;
    const std::int32_t pixel =
        index_at[static_cast<std::size_t>(y) * camera.width + static_cast<std::size_t>(x)];
    if (pixel < 0 || std::abs(pixels.depth_m[pixel] - p.z()) > kDepthTolerance_m) continue;
    const float weight = cosine * cosine * pixel_weight[pixel];
    if (weight < kLeastWeight) continue;
    float observed[3];
    sample_bilinear(observed_linear, x, y, observed);
    const auto basis = sh_basis(normal.x(), normal.y(), normal.z());
    for (int c = 0; c < 3; ++c) {
      float lit = 0.0f;
      for (int k = 0; k < 9; ++k) lit += basis[k] * light.coefficients[k][c];
      const float albedo = std::min(encode_intensity(observed[c] / std::max(lit, 0.01f)), 2.0f);
      seen[c] += weight / (seen[3] + weight) * (albedo - seen[c]);
    }
    seen[3] += weight;
  }
  rebuild();
}

void Appearance::rebuild() {
  AlbedoPyramid::Level& finest = pyramid_.levels.front();
  for (std::size_t i = 0; i < atlas_.size(); ++i) {
    const float* seen = seen_.data() + 4 * i;
    float* texel = finest.texels.data() + std::size_t{4} * atlas_.texel[i];
    const bool is_seen = seen[3] > prior_confidence_[i];
    for (int c = 0; c < 3; ++c) texel[c] = is_seen ? seen[c] : prior_[3 * i + c];
    texel[3] = is_seen ? std::min(1.0f, 2.0f * seen[3]) : prior_confidence_[i];
  }
  pyramid_.levels.resize(1);
  while (pyramid_.levels.back().width > 16) pyramid_.levels.push_back(half(pyramid_.levels.back()));
}

Image Appearance::texture() const {
  const AlbedoPyramid::Level& finest = pyramid_.levels.front();
  Image out(finest.width, finest.height, 3);
  for (std::size_t i = 0; i < static_cast<std::size_t>(finest.width) * finest.height; ++i) {
    for (int c = 0; c < 3; ++c)
      out.data[3 * i + c] = finest.texels[4 * i + c] * finest.texels[4 * i + c];
  }
  return out;
}

double Appearance::seen_fraction() const {
  std::size_t count = 0;
  for (std::size_t i = 0; i < atlas_.size(); ++i)
    count += seen_[4 * i + 3] > prior_confidence_[i] ? 1 : 0;
  return atlas_.size() == 0 ? 0.0 : static_cast<double>(count) / static_cast<double>(atlas_.size());
}

}  // namespace semblance
