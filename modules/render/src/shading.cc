#include "semblance/render/shading.h"

#include "kernels.h"
#include "semblance/core/errors.h"

namespace semblance {

void interpolate(const VisiblePixels& pixels, const Mesh& mesh, int first_triangle,
                 const VertexRows& rows, std::span<PixelList> out) {
  InterpolateArgs args{static_cast<std::int64_t>(pixels.size()),
                       pixels.triangle.data(),
                       pixels.b1.data(),
                       pixels.b2.data(),
                       mesh.triangles.data(),
                       first_triangle,
                       rows.data(),
                       {}};
  for (std::size_t k = 0; k < out.size(); ++k) {
    out[k].resize(pixels.size());
    args.out[k] = out[k].data();
  }
  best_kernels().interpolate(args);
}

void normalize(PixelList& x, PixelList& y, PixelList& z) {
  best_kernels().normalize(static_cast<std::int64_t>(x.size()), x.data(), y.data(), z.data());
}

void sample_texture(const Image& texture, const PixelList& u, const PixelList& v,
                    std::array<PixelList, 3>& rgb) {
  if (texture.channels != 3 || texture.empty())
    throw InvalidInput("a texture has " + std::to_string(texture.channels) +
                       " channels: expected 3, linear RGB");
  for (PixelList& list : rgb) list.resize(u.size());
  best_kernels().sample({static_cast<std::int64_t>(u.size()),
                         u.data(),
                         v.data(),
                         texture.data.data(),
                         texture.width,
                         texture.height,
                         {rgb[0].data(), rgb[1].data(), rgb[2].data()}});
}

void apply_light(const ShLight& light, const std::array<PixelList, 3>& normal,
                 std::array<PixelList, 3>& rgb) {
  LightArgs args{};
  args.count = static_cast<std::int64_t>(rgb[0].size());
  for (int c = 0; c < 3; ++c) {
    args.normal[c] = normal[c].data();
    args.rgb[c] = rgb[c].data();
    for (int k = 0; k < 9; ++k) args.coefficients[k][c] = light.coefficients[k][c];
  }
  best_kernels().light(args);
}

}  // namespace semblance
