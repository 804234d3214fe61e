#include "semblance/cost/surface_equations.h"

#include <gtest/gtest.h>

#include <set>

#include "processor.h"
#include "semblance/core/random.h"
#include "sheet.h"
#include "surface_kernel.h"

namespace semblance {
namespace {

/// Random residuals on a sheet: their dense Jacobian beside the sums that never form it.
struct SurfaceTest : ::testing::TestWithParam<int> {
  SurfaceTopology topology{testing::make_sheet(9).mesh->triangles};
  Random random{7};

  Eigen::MatrixXd random_motion(Eigen::Index rows, Eigen::Index columns) {
    Eigen::MatrixXd out(rows, columns);
    for (Eigen::Index i = 0; i < out.size(); ++i) out.data()[i] = random.normal();
    return out;
  }
};

TEST_P(SurfaceTest, EqualDenseNormalEquations) {
  const Eigen::Index columns = GetParam();
  SurfaceEquations equations(&topology);
  for (int round = 0; round < 2; ++round) {  // the second one after reset
    equations.reset();
    const Eigen::MatrixXd motion = random_motion(2 * topology.vertex_count, columns);
    Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(columns, columns);
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(columns);
    std::set<int> touched;
    for (int k = 0; k < 400; ++k) {
      // A third of the triangles, some of them often.
      const int t = 3 * random.integer(static_cast<int>(topology.triangles.size()) / 3) + round;
      double b1 = random.uniform(), b2 = random.uniform();
      if (b1 + b2 > 1.0) b1 = 1.0 - b1, b2 = 1.0 - b2;
      const double b[3] = {1.0 - b1 - b2, b1, b2};
      // Residual with image gradient g and weight w: m = w g g', v = w r g.
      const Eigen::RowVector2d g(random.normal(), random.normal());
      const double w = random.uniform(), r = random.normal();
      Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(columns);
      for (int c = 0; c < 3; ++c) {
        touched.insert(topology.triangles[t][c]);
        row += b[c] * g * motion.middleRows<2>(2 * topology.triangles[t][c]);
      }
      hessian += w * row.transpose() * row;
      gradient += w * r * row.transpose();
      const auto f = [](double value) { return static_cast<float>(value); };
      const float m[3] = {f(w * g[0] * g[0]), f(w * g[0] * g[1]), f(w * g[1] * g[1])};
      if (k % 2 == 0) {
        equations.add(t, f(b[0]), f(b[1]), f(b[2]), m[0], m[1], m[2], f(w * r * g[0]),
                      f(w * r * g[1]));
      } else {  // by the documented order of the sums
        float* a = equations.accumulators(std::vector<std::int32_t>{t}).of(t);
        for (int p = 0; p < 3; ++p, a += 8) {
          for (int j = 0; j < 3; ++j) {
            a[j] += f(b[p] * b[p]) * m[j];
            a[4 + j] += f(b[(p + 1) % 3] * b[(p + 2) % 3]) * m[j];
          }
          a[3] += f(b[p] * w * r * g[0]);
          a[7] += f(b[p] * w * r * g[1]);
        }
      }
    }
    ASSERT_EQ(std::vector<int>(touched.begin(), touched.end()), equations.touched_vertices());
    SurfaceEquations::Motion rows = SurfaceEquations::Motion::Zero(
        2 * static_cast<Eigen::Index>(touched.size()), SurfaceEquations::padded_columns(columns));
    Eigen::Index at = 0;
    for (const int vertex : touched) {
      rows.block(at, 0, 2, columns) = motion.middleRows<2>(2 * vertex).cast<float>();
      at += 2;
    }
    NormalEquations out;
    out.reset(columns);
    out.hessian.setConstant(1.0);  // what was there stays
    out.gradient.setConstant(2.0);
    equations.assemble(rows, out);
    EXPECT_LT((out.hessian.array() - 1.0 - hessian.array()).matrix().norm(), 1e-5 * hessian.norm());
    EXPECT_LT((out.gradient.array() - 2.0 - gradient.array()).matrix().norm(),
              1e-5 * gradient.norm());
  }
}
INSTANTIATE_TEST_SUITE_P(Columns, SurfaceTest, ::testing::Values(1, 6, 8, 17, 43, 70));

#if defined(__x86_64__)
TEST(SurfaceKernel, AllBuildsAgree) {
  constexpr int count = 150, edges = 200;
  constexpr std::size_t stride = 48;
  Random random(11);
  const auto numbers = [&](std::size_t size) {
    std::vector<float> out(size);
    for (float& value : out) value = static_cast<float>(random.normal());
    return out;
  };
  const std::vector<float> motion = numbers(2 * count * stride), own = numbers(4 * count);
  const std::vector<float> pull = numbers(count), blocks = numbers(4 * edges);
  std::vector<int> vertices, slots, first{0};
  std::vector<SurfaceSpoke> spokes;
  for (int v = 0; v < 2 * count; ++v) {  // every other vertex matters
    slots.push_back(v % 2 == 0 ? v / 2 : -1);
    if (v % 2 == 0) vertices.push_back(v);
    for (int k = 0; k < 6; ++k)
      spokes.push_back({random.integer(edges), random.integer(2 * count)});
    first.push_back(static_cast<int>(spokes.size()));
  }
  const detail::SurfaceSums sums{vertices.size(), stride,        motion.data(), vertices.data(),
                                 slots.data(),    spokes.data(), first.data(),  own.data(),
                                 pull.data(),     blocks.data()};
  std::vector<float> scratch(detail::surface_scratch_rows * stride);
  const auto run = [&](detail::SurfaceKernel kernel) {
    Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> out =
        Eigen::MatrixXf::Zero(stride + 1, stride);
    kernel(sums, scratch.data(), out.data(), out.row(stride).data());
    for (Eigen::Index r = 0; r < out.rows() - 1; ++r) out.row(r).tail(out.cols() - r - 1).setZero();
    return out;
  };
  const auto plain = run(detail::portable_surface_kernel);
  EXPECT_GT(plain.norm(), 1.0f);
  if (detail::has_avx2()) {
    EXPECT_LT((run(detail::avx2_surface_kernel) - plain).norm(), 1e-6f * plain.norm());
  }
  if (detail::has_avx512()) {
    EXPECT_LT((run(detail::avx512_surface_kernel) - plain).norm(), 1e-6f * plain.norm());
  }
}
#endif

}  // namespace
}  // namespace semblance
