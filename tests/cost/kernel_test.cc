#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "photometric_kernel.h"
#include "processor.h"
#include "semblance/core/random.h"

namespace semblance::detail {
namespace {

/// Random input of any size, and a plain evaluation in double precision straight from the formulas.
struct Scene {
  Random random{13};
  std::size_t count;
  std::vector<std::int32_t> triangle, pixel, corners;
  std::vector<float> b1, b2, weight, texels, observed, gradient;
  std::vector<VertexRecord> vertices;
  static constexpr int width = 19, height = 23, pixels = 3000, triangles = 40, vertex_count = 30;

  explicit Scene(std::size_t count_in) : count(count_in) {
    const auto number = [&](double low, double high) {
      return static_cast<float>(random.uniform(low, high));
    };
    for (std::size_t i = 0; i < count; ++i) {
      triangle.push_back(random.integer(triangles));
      // In runs, as the rows of a picture have.
      pixel.push_back(i == 0 ? 0 : pixel.back() + (random.integer(40) == 0 ? 30 : 1));
      b1.push_back(number(0.0, 0.5));
      b2.push_back(number(0.0, 0.5));
    }
    for (int i = 0; i < 3 * triangles; ++i) corners.push_back(random.integer(vertex_count));
    for (int i = 0; i < triangles; ++i) weight.push_back(number(0.0, 1.0));
    for (int i = 0; i < 4 * width * height; ++i) texels.push_back(number(0.0, 1.0));
    for (int i = 0; i < pixels; ++i) {
      for (int c = 0; c < 4; ++c) observed.push_back(c < 3 ? number(0.0, 1.0) : 0.0f);
      for (int c = 0; c < 8; ++c) gradient.push_back(c % 4 < 3 ? number(-0.2, 0.2) : 0.0f);
    }
    for (int i = 0; i < vertex_count; ++i) {  // some beyond the texture, which is clamped
      vertices.push_back({number(-3.0, width + 2.0), number(-3.0, height + 2.0), 0.0f, 0.0f,
                          number(0.2, 1.0), number(0.2, 1.0), number(0.2, 1.0), 1.0f});
    }
  }
  ShadeInput shading() const {
    return {count,           triangle.data(), b1.data(),     b2.data(), corners.data(),
            vertices.data(), weight.data(),   texels.data(), width,     height};
  }
  CompareInput comparison() const {
    return {pixel.data(), observed.data(), gradient.data(), 1.0f / (0.1f * 0.1f), 1.0f / 9.0f};
  }

  std::array<double, 4> colour(std::size_t i) const {
    const std::int32_t* corner = corners.data() + std::ptrdiff_t{3} * triangle[i];
    const double b[3] = {1.0 - b1[i] - b2[i], b1[i], b2[i]};
    double column = 0, row = 0, light[3] = {0, 0, 0};
    for (int k = 0; k < 3; ++k) {
      const VertexRecord& v = vertices[corner[k]];
      column += b[k] * v.column, row += b[k] * v.row;
      light[0] += b[k] * v.red, light[1] += b[k] * v.green, light[2] += b[k] * v.blue;
    }
    column = std::clamp(column, 0.0, width - 1.0), row = std::clamp(row, 0.0, height - 1.0);
    const int c0 = std::min(static_cast<int>(column), width - 2);
    const int r0 = std::min(static_cast<int>(row), height - 2);
    std::array<double, 4> out{};
    for (int c = 0; c < 4; ++c) {
      for (int k = 0; k < 4; ++k) {
        const double share =
            (k % 2 == 1 ? column - c0 : c0 + 1 - column) * (k / 2 == 1 ? row - r0 : r0 + 1 - row);
        out[c] += share * texels[4 * ((r0 + k / 2) * width + c0 + k % 2) + c];
      }
      out[c] *= c < 3 ? light[c] : weight[triangle[i]];
    }
    return out;
  }

  struct Result {
    std::vector<double> colour, accumulators = std::vector<double>(24 * triangles);
    double cost = 0.0, weight = 0.0;
  };
  Result expected(double scale) const {
    Result out;
    for (std::size_t i = 0; i < count; ++i) {
      const std::array<double, 4> shaded = colour(i);
      out.colour.insert(out.colour.end(), shaded.begin(), shaded.end());
      double square = 0, xx = 0, xy = 0, yy = 0, vx = 0, vy = 0;
      for (int c = 0; c < 3; ++c) {
        const double r = shaded[c] - observed[4 * pixel[i] + c];
        const double gx = gradient[8 * pixel[i] + c], gy = gradient[8 * pixel[i] + 4 + c];
        square += r * r;
        xx += gx * gx, xy += gx * gy, yy += gy * gy;
        vx -= gx * r, vy -= gy * r;
      }
      const double s = square / (0.1 * 0.1), q = 1.0 / (1.0 + s / 9.0);
      out.weight += shaded[3];
      out.cost += 0.5 * shaded[3] * s * q;
      const double w = scale * shaded[3] * q * q / (0.1 * 0.1);
      const double b[3] = {1.0 - b1[i] - b2[i], b1[i], b2[i]};
      const double m[3] = {xx, xy, yy};
      double* a = out.accumulators.data() + std::ptrdiff_t{24} * triangle[i];
      for (int k = 0; k < 3; ++k, a += 8) {
        for (int j = 0; j < 3; ++j) {
          a[j] += w * b[k] * b[k] * m[j];
          a[4 + j] += w * b[(k + 1) % 3] * b[(k + 2) % 3] * m[j];
        }
        a[3] += w * b[k] * vx;
        a[7] += w * b[k] * vy;
      }
    }
    return out;
  }
};

void expect_formulas(const Kernel& kernel) {
  for (const std::size_t count : {1u, 2u, 3u, 4u, 5u, 255u, 256u, 257u, 1001u}) {
    const Scene scene(count);
    const ShadeInput shading = scene.shading();
    const CompareInput comparison = scene.comparison();
    constexpr float scale = 0.7f;
    const Scene::Result expected = scene.expected(scale);
    const double tolerance = 1e-5 * (1.0 + expected.cost);

    std::vector<float> colour(4 * count);
    EXPECT_NEAR(kernel.shade(shading, colour.data()), expected.weight, 1e-5 * count);
    for (std::size_t i = 0; i < colour.size(); ++i)
      ASSERT_NEAR(colour[i], expected.colour[i], 1e-5) << i << " of " << count << " pixels";

    const CompareSums sums = kernel.compare(shading, comparison);
    EXPECT_NEAR(sums.cost, expected.cost, tolerance);
    EXPECT_NEAR(sums.weight, expected.weight, 1e-5 * count);

    std::vector<float> accumulators(24 * Scene::triangles, 1.0f);  // what was there stays
    std::vector<std::int32_t> slots(Scene::triangles);
    std::iota(slots.begin(), slots.end(), 0);
    EXPECT_NEAR(kernel.linearize(shading, comparison, colour.data(), scale,
                                 {accumulators.data(), slots.data()}),
                expected.cost, tolerance);
    double largest = 0.0;
    for (const double value : expected.accumulators) largest = std::max(largest, std::abs(value));
    for (std::size_t i = 0; i < accumulators.size(); ++i)
      ASSERT_NEAR(accumulators[i] - 1.0, expected.accumulators[i], 1e-5 * (1.0 + largest))
          << "sum " << i << " of " << count << " pixels";
  }
}

/// Light from the formulas, in double precision.
void expect_light(const Kernel& kernel) {
  for (const std::size_t count : {1u, 15u, 16u, 255u, 256u, 257u, 700u}) {
    Random random(17);
    std::vector<float> normals, uvs;
    for (std::size_t i = 0; i < count; ++i) {
      for (int k = 0; k < 3; ++k) normals.push_back(static_cast<float>(random.uniform(-0.6, 0.6)));
      for (int k = 0; k < 2; ++k) uvs.push_back(static_cast<float>(random.uniform()));
    }
    LightInput input{count, normals.data(), uvs.data(), {}, 64, 48};
    for (auto& coefficient : input.coefficients)
      for (float& value : coefficient) value = static_cast<float>(random.uniform(-0.5, 0.8));
    std::vector<VertexRecord> records(count);
    kernel.light_vertices(input, records.data());
    for (std::size_t i = 0; i < count; ++i) {
      const double x = normals[3 * i], y = normals[3 * i + 1], z = normals[3 * i + 2];
      const double basis[9] = {1, y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y};
      double light[3] = {0, 0, 0};
      for (int c = 0; c < 3; ++c) {
        for (int k = 0; k < 9; ++k) light[c] += basis[k] * input.coefficients[k][c];
        light[c] = std::sqrt(std::max(light[c], 0.01));
      }
      ASSERT_NEAR(records[i].column, 64 * uvs[2 * i] - 0.5, 1e-5);
      ASSERT_NEAR(records[i].row, 48 * (1 - uvs[2 * i + 1]) - 0.5, 1e-5);
      ASSERT_NEAR(records[i].red, light[0], 1e-5);
      ASSERT_NEAR(records[i].green, light[1], 1e-5);
      ASSERT_NEAR(records[i].blue, light[2], 1e-5);
      ASSERT_EQ(records[i].one, 1.0f);
    }
  }
}

TEST(PhotometricKernel, PortableFollowsTheFormulas) {
  expect_formulas(portable_kernel);
  expect_light(portable_kernel);
}

#if defined(__x86_64__)
TEST(PhotometricKernel, Avx2FollowsTheFormulas) {
  if (!has_avx2()) GTEST_SKIP() << "needs AVX2 and FMA";
  expect_formulas(avx2_kernel);
  expect_light(avx2_kernel);
}

TEST(PhotometricKernel, Avx512FollowsTheFormulas) {
  if (!has_avx512()) GTEST_SKIP() << "needs AVX-512";
  expect_formulas(avx512_kernel);
  expect_light(avx512_kernel);
}
#endif

}  // namespace
}  // namespace semblance::detail
