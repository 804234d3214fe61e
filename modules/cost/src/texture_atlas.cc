#include "semblance/cost/texture_atlas.h"

#include <algorithm>
#include <cmath>

namespace semblance {

namespace {

struct Owner {
  std::int32_t triangle = -1;
  float b1 = 0, b2 = 0;
};

/// Barycentrics of the point of the segment-clamped triangle nearest (in barycentric terms).
Owner clamp_into(std::int32_t triangle, float b1, float b2) {
  float b[3] = {std::max(1.0f - b1 - b2, 0.0f), std::max(b1, 0.0f), std::max(b2, 0.0f)};
  const float sum = b[0] + b[1] + b[2];
  return {triangle, b[1] / sum, b[2] / sum};
}

}  // namespace

TextureAtlas make_texture_atlas(const Mesh& mesh, int width, int height) {
  std::vector<Owner> owner(static_cast<std::size_t>(width) * height);
  std::vector<std::uint8_t> inside(owner.size(), 0);
  for (Eigen::Index t = 0; t < mesh.triangle_count(); ++t) {
    Eigen::Vector2d p[3];
    for (int k = 0; k < 3; ++k) {
      const auto uv = mesh.uvs.row(mesh.triangles(t, k));
      p[k] = {uv[0] * width, (1.0 - uv[1]) * height};
    }
    const Eigen::Vector2d e1 = p[1] - p[0], e2 = p[2] - p[0];
    const double area = e1.x() * e2.y() - e1.y() * e2.x();
    if (std::abs(area) < 1e-9) continue;
    const double margin = 1.0;  // texels around the chart
    const int x0 = std::max(
        0, static_cast<int>(std::floor(std::min({p[0].x(), p[1].x(), p[2].x()}) - margin)));
    const int x1 = std::min(
        width - 1, static_cast<int>(std::ceil(std::max({p[0].x(), p[1].x(), p[2].x()}) + margin)));
    const int y0 = std::max(
        0, static_cast<int>(std::floor(std::min({p[0].y(), p[1].y(), p[2].y()}) - margin)));
    const int y1 = std::min(
        height - 1, static_cast<int>(std::ceil(std::max({p[0].y(), p[1].y(), p[2].y()}) + margin)));
    // Barycentric distance that corresponds to the margin, from the shortest altitude.
    const double longest = std::max({e1.norm(), e2.norm(), (p[2] - p[1]).norm()});
    const double slack = margin * 1.5 * longest / std::abs(area);
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        const Eigen::Vector2d d = Eigen::Vector2d(x + 0.5, y + 0.5) - p[0];
        const double b1 = (d.x() * e2.y() - d.y() * e2.x()) / area;
        const double b2 = (e1.x() * d.y() - e1.y() * d.x()) / area;
        const double least = std::min({b1, b2, 1.0 - b1 - b2});
        const std::size_t index = static_cast<std::size_t>(y) * width + x;
        if (least >= 0.0) {
          owner[index] = {static_cast<std::int32_t>(t), static_cast<float>(b1),
                          static_cast<float>(b2)};
          inside[index] = 1;
        } else if (least >= -slack && inside[index] == 0 && owner[index].triangle < 0) {
          owner[index] = clamp_into(static_cast<std::int32_t>(t), static_cast<float>(b1),
                                    static_cast<float>(b2));
        }
      }
    }
  }
  TextureAtlas atlas;
  atlas.width = width;
  atlas.height = height;
  for (std::size_t i = 0; i < owner.size(); ++i) {
    if (owner[i].triangle < 0) continue;
    atlas.texel.push_back(static_cast<std::int32_t>(i));
    atlas.triangle.push_back(owner[i].triangle);
    atlas.b1.push_back(owner[i].b1);
    atlas.b2.push_back(owner[i].b2);
  }
  return atlas;
}

}  // namespace semblance
