#include "semblance/cost/appearance.h"

#include <gtest/gtest.h>

#include "semblance/cost/light.h"
#include "semblance/cost/photometric.h"
#include "semblance/render/renderer.h"
#include "sheet.h"

namespace semblance {
namespace {

using testing::Sheet;

ShLight make_light() {
  ShLight light;
  light.coefficients[0] = {0.8f, 0.75f, 0.7f};
  light.coefficients[1] = {0.2f, 0.15f, 0.1f};
  light.coefficients[2] = {0.1f, 0.2f, 0.15f};
  light.coefficients[3] = {-0.2f, -0.1f, 0.1f};
  light.coefficients[5] = {0.05f, 0.0f, -0.05f};
  light.coefficients[7] = {0.0f, 0.06f, 0.04f};
  return light;
}

/// The sheet's pattern, bent over most of a half sphere that faces the camera.
struct Dome {
  std::shared_ptr<Mesh> mesh = std::make_shared<Mesh>(*testing::make_sheet(40).mesh);
  Camera camera = Camera::centred(120, 120, 300.0);
  Scene scene;
  Rasteriser rasteriser;
  VisiblePixels pixels;
  ParameterSpace space;
  Eigen::VectorXd x;
  SurfaceTopology topology{mesh->triangles};
  PointsF colour;

  Dome() {
    colour.resize(mesh->vertex_count(), 3);
    for (Eigen::Index i = 0; i < colour.rows(); ++i) {
      const double a = 2.4 * (mesh->uvs(i, 0) - 0.5), b = 2.4 * (mesh->uvs(i, 1) - 0.5);
      mesh->positions_m.row(i) << 0.1 * std::sin(a) * std::cos(b), 0.1 * std::sin(b),
          0.1 * std::cos(a) * std::cos(b) - 0.6;
      colour.row(i) = testing::sheet_colour(mesh->uvs(i, 0), mesh->uvs(i, 1)).transpose();
    }
    scene.objects.resize(1);
    SceneObject& object = scene.objects[0];
    object.mesh = mesh;
    object.positions_m = mesh->positions_m.cast<float>();
    vertex_normals(object.positions_m, mesh->triangles, object.normals);
    scene.light = make_light();
    rasteriser.visible_pixels(scene, camera, nullptr, pixels);
  }
  Appearance appearance(const PointsF& prior, float confidence) const {
    return {*mesh, 128, prior,
            std::vector<float>(static_cast<std::size_t>(mesh->vertex_count()), confidence)};
  }
  Appearance known() const { return appearance(colour, 1.0f); }
  /// Drawn by the renderer, which shares nothing with the cost's shading.
  Image photograph() {
    scene.objects[0].material.texture = std::make_shared<Image>(known().texture());
    return make_renderer("raster")->render(scene, camera, Channel::colour).colour;
  }
  Synthesis synthesis() const {
    return {space, x, scene, camera, pixels, rasteriser.projected_vertices()};
  }
};

TEST(EstimateLight, RecoversTheLightOfAPicture) {
  Dome dome;
  const Observation observation = make_observation(dome.photograph(), 1);
  const Appearance appearance = dome.known();
  dome.scene.light = ShLight();
  LightOptions options;
  options.pull = 1e-6;
  const ShLight found =
      estimate_light(dome.synthesis(), observation.levels[0], appearance, dome.topology,
                     std::vector<float>(dome.pixels.size(), 1.0f), options);
  // Compared where there are normals to tell: coefficients alone may trade with one another.
  const auto shine = [](const ShLight& light, const auto& n) {
    const auto basis = sh_basis(n[0], n[1], n[2]);
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    for (int k = 0; k < 9; ++k) sum += basis[k] * light.coefficients[k];
    return sum;
  };
  const PointsF& normals = dome.scene.objects[0].normals;
  for (const std::int32_t t : dome.pixels.triangle) {
    const auto n = normals.row(dome.mesh->triangles(t, 0));
    ASSERT_LT((shine(found, n) - shine(make_light(), n)).norm(), 0.02f) << n;
  }
}

TEST(EstimateLight, KeepsWhatItMayNotChange) {
  Dome dome;
  const Observation observation = make_observation(dome.photograph(), 1);
  const Appearance appearance = dome.known();
  dome.scene.light = ShLight();
  dome.scene.light.coefficients[6] = {0.05f, 0.06f, 0.07f};
  const std::vector<float> weight(dome.pixels.size(), 1.0f);
  LightOptions options;
  options.order = 1;
  ShLight found = estimate_light(dome.synthesis(), observation.levels[0], appearance, dome.topology,
                                 weight, options);
  for (int k = 4; k < 9; ++k) {
    EXPECT_LT((found.coefficients[k] - dome.scene.light.coefficients[k]).norm(), 1e-5f) << k;
  }
  EXPECT_GT((found.coefficients[3] - dome.scene.light.coefficients[3]).norm(), 0.05f);
  options.pull = 1e6;  // so strong that nothing moves
  found = estimate_light(dome.synthesis(), observation.levels[0], appearance, dome.topology, weight,
                         options);
  for (int k = 0; k < 9; ++k)
    EXPECT_LT((found.coefficients[k] - dome.scene.light.coefficients[k]).norm(), 1e-4f) << k;
}

struct GatherTest : ::testing::Test {
  Dome dome;
  Image photograph = dome.photograph();
  PointsF grey = PointsF::Constant(dome.mesh->vertex_count(), 3, 0.25f);
  Appearance appearance = dome.appearance(grey, 0.01f);
  std::vector<float> weight = std::vector<float>(dome.pixels.size(), 1.0f);

  void gather(const Image& image) {
    appearance.gather(image, dome.scene.objects[0], dome.camera, dome.scene.light, dome.pixels,
                      weight);
  }
};

TEST_F(GatherTest, RecoversTheTextureOfAPicture) {
  gather(photograph);
  EXPECT_GT(appearance.seen_fraction(), 0.6);
  const Image found = appearance.texture();
  const TextureAtlas atlas = make_texture_atlas(*dome.mesh, found.width, found.height);
  double worst = 0.0;
  int seen = 0;
  for (std::size_t i = 0; i < atlas.size(); ++i) {
    if (appearance.state()[4 * i + 3] < 0.3f) continue;
    ++seen;
    const int texel = atlas.texel[i];
    const Eigen::Vector3f expected =
        testing::sheet_colour((texel % found.width + 0.5) / found.width,
                              1.0 - (texel / found.width + 0.5) / found.height);
    for (int c = 0; c < 3; ++c)
      worst = std::max<double>(worst, std::abs(found.data[3 * texel + c] - expected[c]));
  }
  EXPECT_GT(seen, 6000);
  EXPECT_LT(worst, 0.03);
}

TEST_F(GatherTest, LeavesUnseenTexelsAlone) {
  const std::vector<float> prior = appearance.albedo().levels[0].texels;
  for (std::size_t i = 0; i < dome.pixels.size(); ++i) {
    if (dome.pixels.pixel[i] % 120 < 60) weight[i] = 0.0f;  // the left half is hidden
  }
  gather(photograph);
  const TextureAtlas atlas = make_texture_atlas(*dome.mesh, 128, 128);
  int unseen = 0, seen = 0;
  for (std::size_t i = 0; i < atlas.size(); ++i) {
    const std::size_t texel = std::size_t{4} * atlas.texel[i];
    if (appearance.state()[4 * i + 3] > 0.0f) {
      ++seen;
      EXPECT_GT(atlas.texel[i] % 128, 61);
      continue;
    }
    ++unseen;
    for (std::size_t c = 0; c < 4; ++c)
      ASSERT_EQ(appearance.albedo().levels[0].texels[texel + c], prior[texel + c]);
  }
  EXPECT_GT(seen, 2000);
  EXPECT_GT(unseen, 7000);
}

TEST_F(GatherTest, NeverChangesFinalTexels) {
  for (int view = 0; view < 30; ++view) gather(photograph);
  const std::vector<float> before = appearance.state();
  for (int view = 0; view < 3; ++view) gather(Image(120, 120, 3, 0.9f));  // a wrong pose, say
  int final = 0, open = 0;
  for (std::size_t i = 0; i < before.size(); i += 4) {
    const bool is_final = before[i + 3] >= 4.0f;
    const bool changed =
        !std::equal(before.begin() + i, before.begin() + i + 4, appearance.state().begin() + i);
    EXPECT_FALSE(is_final && changed) << i / 4;
    final += is_final ? 1 : 0;
    open += !is_final && changed ? 1 : 0;
  }
  EXPECT_GT(final, 6000);
  EXPECT_GT(open, 10);  // texels seen at a slant are still being averaged
}

TEST_F(GatherTest, IsRestoredFromItsState) {
  gather(photograph);
  Appearance copy = dome.appearance(grey, 0.01f);
  copy.state() = appearance.state();
  copy.rebuild();
  for (std::size_t level = 0; level < copy.albedo().levels.size(); ++level)
    EXPECT_EQ(copy.albedo().levels[level].texels, appearance.albedo().levels[level].texels);
}

}  // namespace
}  // namespace semblance
