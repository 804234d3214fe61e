// The passes from visible pixels to colours. Each runs over lists with one entry per visible pixel
// and one list per component, which is what keeps them wide.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "semblance/core/image.h"
#include "semblance/core/mesh.h"
#include "semblance/core/scene.h"
#include "semblance/render/visibility.h"

namespace semblance {

/// Up to four attributes per vertex, one row each; a row is one load.
using VertexRows = Eigen::Matrix<float, Eigen::Dynamic, 4, Eigen::RowMajor>;

using PixelList = std::vector<float>;

/// out[k][i] = column k of `rows` at visible pixel i, for the first out.size() columns. All pixels
/// must see triangles of one mesh, whose first triangle has the number `first_triangle`.
void interpolate(const VisiblePixels& pixels, const Mesh& mesh, int first_triangle,
                 const VertexRows& rows, std::span<PixelList> out);

/// Scales the vectors (x[i], y[i], z[i]) to length one; zero vectors stay zero.
void normalize(PixelList& x, PixelList& y, PixelList& z);

/// Bilinear colour of a texture with three channels at (u[i], v[i]), clamped at the border
/// (core/conventions.h). Throws InvalidInput if it has another number of channels.
void sample_texture(const Image& texture, const PixelList& u, const PixelList& v,
                    std::array<PixelList, 3>& rgb);

/// Multiplies rgb by the light that falls on surfaces with these unit normals (ShLight).
void apply_light(const ShLight& light, const std::array<PixelList, 3>& normal,
                 std::array<PixelList, 3>& rgb);

}  // namespace semblance
