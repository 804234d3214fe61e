#include "semblance/cost/photometric.h"

#include <gtest/gtest.h>

#include "semblance/core/errors.h"
#include "semblance/core/random.h"
#include "semblance/cost/contract.h"
#include "sheet.h"

namespace semblance {
namespace {

using testing::Sheet;

/// What the sheet looks like at x through its camera, as the cost itself draws it.
Image picture(Sheet& sheet, const Appearance& appearance, const Eigen::VectorXd& x) {
  const Observation nothing = make_observation(Image(64, 56, 3), 1);
  const PhotometricCost cost(&nothing.levels[0], &appearance, &sheet.topology,
                             &sheet.triangle_weight, {});
  Image out(64, 56, 3);
  sheet.objective({}).with_synthesis(x, [&](const Synthesis& s) {
    ShadedPixels shaded;
    cost.shade(s, shaded);
    for (std::size_t i = 0; i < s.pixels.size(); ++i) {
      for (int c = 0; c < 3; ++c) {
        const float encoded = shaded.colour[4 * i + c];
        out.data[3 * s.pixels.pixel[i] + c] = encoded * encoded;
      }
    }
  });
  return out;
}

struct PhotometricTest : ::testing::Test {
  Sheet sheet;
  Appearance appearance = sheet.appearance();
  Observation observation = make_observation(picture(sheet, appearance, sheet.x), 1);
  PhotometricOptions options = [] {
    PhotometricOptions out;
    out.sigma = 0.1;
    return out;
  }();

  PhotometricCost cost() const {
    return {&observation.levels[0], &appearance, &sheet.topology, &sheet.triangle_weight, options};
  }
  NormalEquations equations(const PhotometricCost& photometric, const Eigen::VectorXd& x) {
    NormalEquations out;
    EXPECT_TRUE(sheet.objective({&photometric}).normal_equations(x, out));
    return out;
  }
  Eigen::VectorXd differences(const PhotometricCost& photometric, const Eigen::VectorXd& x) {
    const SynthesisObjective objective = sheet.objective({&photometric});
    const Eigen::VectorXd step = 0.02 * objective.space().tangent_scale().cwiseMin(0.01);
    Eigen::VectorXd out(step.size());
    for (Eigen::Index k = 0; k < step.size(); ++k) {
      const Eigen::VectorXd d = step[k] * Eigen::VectorXd::Unit(step.size(), k);
      out[k] = (objective.evaluate(objective.space().plus(x, d)) -
                objective.evaluate(objective.space().plus(x, -d))) /
               (2.0 * step[k]);
    }
    return out;
  }
};

TEST_F(PhotometricTest, VanishesWhereTheImageWasTaken) {
  const PhotometricCost photometric = cost();
  const NormalEquations at = equations(photometric, sheet.x);
  EXPECT_LT(at.cost, 1e-9);
  EXPECT_GT(equations(photometric, sheet.offset(1.0, 1)).cost, 1.0);
}

TEST_F(PhotometricTest, KeepsTheContract) {
  const PhotometricCost photometric = cost();
  const SynthesisObjective objective = sheet.objective({&photometric});
  const std::vector<Eigen::VectorXd> points{sheet.offset(0.5, 1), sheet.offset(3.0, 2)};
  CostAccuracy accuracy;
  accuracy.gradient = std::numeric_limits<double>::infinity();  // see the next two tests
  EXPECT_COST_CONTRACT(
      photometric, sheet.topology, objective.space(),
      [&](const Eigen::VectorXd& x, const auto& use) { objective.with_synthesis(x, use); }, points,
      accuracy);
}

/// The gradient is that of a sum over points that stay on the surface and carry their colour along:
/// rho(synthetic_i - observed(pixel of point i)). Here that sum is evaluated straight, from the
/// model's positions and a bilinear look-up in the observed picture, at any distance.
TEST_F(PhotometricTest, GradientIsThatOfPointsFixedToTheSurface) {
  options.reference_pixels = 1000.0;
  const PhotometricCost photometric = cost();
  const SynthesisObjective objective = sheet.objective({&photometric});
  const ObservationLevel& level = observation.levels[0];
  for (const double distance : {0.5, 3.0, 6.0}) {
    const Eigen::VectorXd x0 = sheet.offset(distance, 2);
    VisiblePixels pixels;
    ShadedPixels shaded;
    objective.with_synthesis(x0, [&](const Synthesis& s) {
      pixels = s.pixels;
      photometric.shade(s, shaded);
    });
    // Colours of the observed picture between pixels: cubic convolution (Keys 1981), whose slope at
    // pixel centres is the central difference that the cost uses.
    const auto observed = [&](double x, double y, int c) {
      const auto weight = [](double t) {
        t = std::abs(t);
        return t < 1.0   ? 1.5 * t * t * t - 2.5 * t * t + 1.0
               : t < 2.0 ? -0.5 * t * t * t + 2.5 * t * t - 4.0 * t + 2.0
                         : 0.0;
      };
      const int cx = static_cast<int>(std::floor(x - 0.5)),
                cy = static_cast<int>(std::floor(y - 0.5));
      double sum = 0.0;
      for (int j = -1; j <= 2; ++j) {
        for (int i = -1; i <= 2; ++i) {
          sum += weight(x - 0.5 - (cx + i)) * weight(y - 0.5 - (cy + j)) *
                 level.colour((cy + j) * level.width + cx + i)[c];
        }
      }
      return sum;
    };
    const auto frozen = [&](const Eigen::VectorXd& x) {
      Scene scene;
      sheet.model.synthesize(x, scene);
      double sum = 0.0, weight = 0.0;
      for (std::size_t i = 0; i < pixels.size(); ++i) {
        const int px = pixels.pixel[i] % 64, py = pixels.pixel[i] / 64;
        weight += 1.0;
        if (px < 3 || py < 3 || px > 60 || py > 52) continue;  // the stencil stays in the picture
        const auto& corner = sheet.topology.triangles[pixels.triangle[i]];
        const double b[3] = {1.0 - pixels.b1[i] - pixels.b2[i], pixels.b1[i], pixels.b2[i]};
        Eigen::Vector3d p = Eigen::Vector3d::Zero();
        for (int k = 0; k < 3; ++k)
          p += b[k] * scene.objects[0].positions_m.row(corner[k]).cast<double>().transpose();
        const Eigen::Vector2d at = project_world(sheet.camera, p);
        double s = 0.0;
        for (int c = 0; c < 3; ++c) {
          const double r = shaded.colour[4 * i + c] - observed(at.x(), at.y(), c);
          s += r * r / (0.1 * 0.1);
        }
        sum += 0.5 * s / (1.0 + s / 9.0);
      }
      return 1000.0 * sum / (8.0 * weight);
    };
    // The same border is left out of the cost by the weight of its triangles being seen: compare
    // the two on the inner pixels only.
    std::vector<float> inner(sheet.topology.triangles.size(), 1.0f);
    VisiblePixels kept;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const int px = pixels.pixel[i] % 64, py = pixels.pixel[i] / 64;
      if (px < 3 || py < 3 || px > 60 || py > 52) continue;
      kept.pixel.push_back(pixels.pixel[i]);
      kept.triangle.push_back(pixels.triangle[i]);
      kept.b1.push_back(pixels.b1[i]);
      kept.b2.push_back(pixels.b2[i]);
      kept.depth_m.push_back(pixels.depth_m[i]);
    }
    NormalEquations found;
    found.reset(8);
    SurfaceEquations surface(&sheet.topology);
    objective.with_synthesis(x0, [&](const Synthesis& s) {
      const Synthesis part{s.space, s.x, s.scene, s.camera, kept, s.projected};
      photometric.evaluate(part, &surface, &found);
    });
    VertexJacobian jacobian;
    std::vector<int> columns{0, 1, 2, 3, 4, 5, 6, 7};
    sheet.model.vertex_jacobian(x0, columns, nullptr, jacobian);
    const std::vector<int>& vertices = surface.touched_vertices();
    SurfaceEquations::Motion motion = SurfaceEquations::Motion::Zero(
        2 * static_cast<Eigen::Index>(vertices.size()), SurfaceEquations::padded_columns(8));
    const Eigen::Matrix3d rotation = sheet.camera.camera_from_world.rotation.toRotationMatrix();
    Scene scene;
    sheet.model.synthesize(x0, scene);
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      const Eigen::Vector3d p =
          sheet.camera.camera_from_world *
          scene.objects[0].positions_m.row(vertices[i]).cast<double>().transpose().eval();
      Eigen::Matrix<double, 2, 3> pixel_from_camera;
      pixel_from_camera << 180.0 / p.z(), 0.0, -180.0 * p.x() / (p.z() * p.z()), 0.0, 180.0 / p.z(),
          -180.0 * p.y() / (p.z() * p.z());
      motion.block<2, 8>(2 * static_cast<Eigen::Index>(i), 0) =
          (pixel_from_camera * rotation * jacobian.middleRows(3 * vertices[i], 3).cast<double>())
              .cast<float>();
    }
    surface.assemble(motion, found);
    const double kept_share = static_cast<double>(kept.size()) / static_cast<double>(pixels.size());
    const Eigen::VectorXd scale = objective.space().tangent_scale().cwiseMin(0.01);
    Eigen::VectorXd expected(8);
    for (Eigen::Index k = 0; k < 8; ++k) {
      const Eigen::VectorXd d = 1e-3 * scale[k] * Eigen::VectorXd::Unit(8, k);
      expected[k] =
          (frozen(objective.space().plus(x0, d)) - frozen(objective.space().plus(x0, -d))) /
          (2e-3 * scale[k] * kept_share);
    }
    EXPECT_LT((found.gradient - expected).cwiseProduct(scale).norm(),
              0.01 * expected.cwiseProduct(scale).norm())
        << distance << " px away: " << found.gradient.transpose() << "\nexpected "
        << expected.transpose();
  }
}

/// The cost compares at fixed pixels instead, so its own slope has the gradient of the synthetic
/// picture in place of that of the observed one: the same when aligned, apart in proportion to the
/// distance otherwise.
TEST_F(PhotometricTest, GradientAgreesWithTheCostNearAlignment) {
  const PhotometricCost photometric = cost();
  const Eigen::VectorXd scale = sheet.model.parameters().tangent_scale().cwiseMin(0.01);
  const auto relative_error = [&](double distance) {
    const Eigen::VectorXd x = sheet.offset(distance, 3);
    const Eigen::VectorXd expected = differences(photometric, x).cwiseProduct(scale);
    return (equations(photometric, x).gradient.cwiseProduct(scale) - expected).norm() /
           expected.norm();
  };
  EXPECT_LT(relative_error(0.25), 0.05);
  EXPECT_LT(relative_error(1.0), 0.15);
}

TEST_F(PhotometricTest, GaussNewtonFindsWhereTheImageWasTaken) {
  const PhotometricCost photometric = cost();
  const SynthesisObjective objective = sheet.objective({&photometric});
  Eigen::VectorXd x = sheet.offset(2.0, 4);
  for (int i = 0; i < 8; ++i) {
    const NormalEquations at = equations(photometric, x);
    x = objective.space().plus(x, -at.hessian.ldlt().solve(at.gradient));
  }
  const Eigen::VectorXd left = objective.space().minus(x, sheet.x);
  EXPECT_LT(left.head<3>().norm(), 1e-3);      // radian: 0.02 px at the edge of the sheet
  EXPECT_LT(left.segment<3>(3).norm(), 2e-4);  // metre
  EXPECT_LT(left.tail<2>().cwiseAbs().maxCoeff(), 2e-3);
}

TEST_F(PhotometricTest, IsAMeanSoThatHidingGainsNothing) {
  const PhotometricCost photometric = cost();
  const Eigen::VectorXd x = sheet.offset(1.0, 1);
  const double all = sheet.objective({&photometric}).evaluate(x);
  for (float& weight : sheet.triangle_weight) weight = 0.25f;
  EXPECT_NEAR(sheet.objective({&photometric}).evaluate(x), all, 1e-5 * all);
  // The cost of a part is the mean over it, for as many pixels as are visible in all.
  std::vector<float>& weight = sheet.triangle_weight;
  const auto part = [&](std::size_t parity) {
    for (std::size_t t = 0; t < weight.size(); ++t) weight[t] = t / 2 % 2 == parity ? 1.0f : 0.0f;
    double seen = 0.0;
    sheet.objective({}).with_synthesis(x, [&](const Synthesis& s) {
      for (const std::int32_t t : s.pixels.triangle) seen += weight[t];
    });
    return std::pair<double, double>(seen, sheet.objective({&photometric}).evaluate(x));
  };
  const auto [n0, cost0] = part(0);
  const auto [n1, cost1] = part(1);
  EXPECT_NEAR((n0 * cost0 + n1 * cost1) / (n0 + n1), all, 1e-5 * all);
}

TEST_F(PhotometricTest, RefusesScenesOfSeveralObjects) {
  const PhotometricCost photometric = cost();
  sheet.objective({}).with_synthesis(sheet.x, [&](const Synthesis& s) {
    Scene two = s.scene;
    two.objects.push_back(two.objects[0]);
    const Synthesis wrong{s.space, s.x, two, s.camera, s.pixels, s.projected};
    EXPECT_THROW(photometric.evaluate(wrong, nullptr, nullptr), InvalidInput);
  });
}

PhotometricCost::Statistics statistics_at(Sheet& sheet, const PhotometricCost& photometric) {
  PhotometricCost::Statistics out;
  sheet.objective({}).with_synthesis(sheet.x,
                                     [&](const Synthesis& s) { out = photometric.statistics(s); });
  return out;
}

TEST_F(PhotometricTest, StatisticsOfIdenticalPictures) {
  const PhotometricCost::Statistics found = statistics_at(sheet, cost());
  EXPECT_EQ(found.pixels, 64u * 56u);
  EXPECT_LT(found.rms, 1e-6);
  EXPECT_NEAR(found.correlation, 1.0, 1e-6);
  EXPECT_EQ(found.inlier_fraction, 1.0);
  for (const float weight : found.pixel_weight) ASSERT_NEAR(weight, 1.0f, 1e-6f);
}

TEST_F(PhotometricTest, StatisticsOfAKnownOccluder) {
  Image occluded = observation.linear;
  for (int y = 0; y < 28; ++y) {  // a quarter of the picture becomes much brighter
    for (int x = 0; x < 32; ++x)
      for (int c = 0; c < 3; ++c) occluded.pixel(x, y)[c] = 4.0f;
  }
  observation = make_observation(occluded, 1);
  const PhotometricCost::Statistics found = statistics_at(sheet, cost());
  EXPECT_NEAR(found.inlier_fraction, 0.75, 1e-9);
  EXPECT_LT(found.correlation, 0.8);
  int doubted = 0;
  for (const float weight : found.pixel_weight) doubted += weight < 0.1f ? 1 : 0;
  EXPECT_EQ(doubted, 32 * 28);
}

TEST_F(PhotometricTest, StatisticsOfKnownNoise) {
  // Independent noise of a known deviation in encoded intensity.
  Random random(17);
  Image noisy = observation.linear;
  for (float& value : noisy.data) {
    const float encoded = encode_intensity(value) + 0.02f * static_cast<float>(random.normal());
    value = encoded * encoded;
  }
  observation = make_observation(noisy, 1);
  const PhotometricCost::Statistics found = statistics_at(sheet, cost());
  EXPECT_NEAR(found.rms, 0.02, 0.0005);
  EXPECT_NEAR(found.sigma, 0.02, 0.001);
  EXPECT_NEAR(found.lag_correlation, 0.0, 0.05);
}

}  // namespace
}  // namespace semblance
