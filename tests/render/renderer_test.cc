#include "semblance/render/renderer.h"

#include <gmock/gmock.h>

#include "renderers.h"
#include "scenes.h"
#include "semblance/io/image_io.h"
#include "semblance/io/mesh_io.h"
#include "semblance/render/contract.h"
#include "support.h"

namespace semblance {
namespace {

using testing::NamedScene;

// The two tolerances by which any two renderers agree: values to 2e-3 (of the unit interval, or of
// the depth), and the share of wrong pixels that each scene states.
constexpr double value_tolerance = 2e-3;

void expect_agreement(const NamedScene& named) {
  std::vector<Frame> frames;
  for (const std::string& name : renderer_names())
    frames.push_back(make_renderer(name)->render(named.scene, named.camera, Channel::all));
  for (std::size_t a = 0; a < frames.size(); ++a) {
    for (std::size_t b = a + 1; b < frames.size(); ++b) {
      const FrameComparison result = compare_frames(frames[a], frames[b], value_tolerance);
      EXPECT_GT(result.seen_pixels, 1000) << named.name;
      EXPECT_LE(result.wrong_pixels, named.wrong_share * result.seen_pixels)
          << named.name << ": " << renderer_names()[a] << " and " << renderer_names()[b];
    }
  }
}

class EveryRenderer : public ::testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Renderer, EveryRenderer, ::testing::ValuesIn(renderer_names()));

TEST_P(EveryRenderer, KeepsTheContract) {
  const std::unique_ptr<Renderer> renderer = make_renderer(GetParam());
  EXPECT_EQ(renderer->name(), GetParam());
  EXPECT_RENDERER_CONTRACT(*renderer);
}

TEST_P(EveryRenderer, RefusesTexturesItCannotUse) {
  NamedScene named = testing::scene_catalogue()[0];
  SceneObject& object = named.scene.objects[0];
  object.material.texture = std::make_shared<Image>(4, 4, 1);
  const std::unique_ptr<Renderer> renderer = make_renderer(GetParam());
  EXPECT_THROW(renderer->render(named.scene, named.camera, Channel::colour), InvalidInput);
  EXPECT_NO_THROW(renderer->render(named.scene, named.camera, Channel::depth));
  object.material.texture = std::make_shared<Image>(4, 4, 3);
  auto without_uvs = std::make_shared<Mesh>(*object.mesh);
  without_uvs->uvs.resize(0, 2);
  object.mesh = without_uvs;
  EXPECT_THROW(renderer->render(named.scene, named.camera, Channel::colour), InvalidInput);
}

class Agreement : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Renderer, Agreement, ::testing::Range(0, 7));

TEST_P(Agreement, AnyTwoRenderersAgree) {
  expect_agreement(testing::scene_catalogue()[GetParam()]);
}

TEST(Agreement, AnyTwoRenderersAgreeOnAScannedHead) {
  const std::string folder = "face/lee-perry-smith/";
  SEMBLANCE_NEED_DATA(folder + "LeePerrySmith.obj");
  const Mesh mesh = read_obj(testing::data_path(folder + "LeePerrySmith.obj")).mesh;
  const Eigen::RowVector3d low = mesh.positions_m.colwise().minCoeff();
  const Eigen::RowVector3d high = mesh.positions_m.colwise().maxCoeff();
  NamedScene named{"scan", {}, Camera::centred(320, 240, 400.0), 0.003};
  SceneObject object;
  object.name = "head";
  object.positions_m =
      ((mesh.positions_m.rowwise() - 0.5 * (low + high)) * (0.3 / (high.y() - low.y())))
          .cast<float>();
  object.positions_m.col(2).array() -= 0.6f;
  vertex_normals(object.positions_m, mesh.triangles, object.normals);
  object.mesh = std::make_shared<Mesh>(mesh);
  object.material.texture =
      std::make_shared<Image>(read_image(testing::data_path(folder + "Map-COL.jpg")));
  named.scene.objects = {object};
  named.scene.light = testing::make_light();
  expect_agreement(named);
}

TEST(Renderer, OpenGlDrawsTheSameOnEitherContext) {
  if (make_egl_context() == nullptr) GTEST_SKIP() << "no EGL surfaceless platform here";
  const NamedScene named = testing::scene_catalogue()[0];
  const Frame expected =
      make_gl_renderer(make_gl_context)->render(named.scene, named.camera, Channel::all);
  const Frame frame =
      make_gl_renderer(make_egl_context)->render(named.scene, named.camera, Channel::all);
  const FrameComparison result = compare_frames(expected, frame, 1e-5);
  EXPECT_GT(result.seen_pixels, 1000);
  EXPECT_EQ(result.wrong_pixels, 0);
}

TEST(Renderer, UnknownNamesAreListed) {
  try {
    make_renderer("opengl");
    FAIL();
  } catch (const InvalidInput& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("raster, osmesa, embree"));
  }
}

TEST(CompareFrames, CountsWhatDiffers) {
  const NamedScene named = testing::scene_catalogue()[0];
  const Frame a = make_renderer("raster")->render(named.scene, named.camera, Channel::all);
  Frame b = a;
  EXPECT_EQ(compare_frames(a, b, 1e-9).wrong_pixels, 0);
  const std::size_t seen =
      std::find_if(a.triangle.begin(), a.triangle.end(), [](int t) { return t >= 0; }) -
      a.triangle.begin();
  b.colour.data[3 * seen] += 0.25f;
  b.triangle[seen + 1] += 1;
  b.depth.data[seen + 2] *= 1.01f;
  EXPECT_EQ(compare_frames(a, b, 1e-9).wrong_pixels, 3);
  const FrameComparison loose = compare_frames(a, b, 0.3);
  EXPECT_EQ(loose.wrong_pixels, 1);
  EXPECT_NEAR(loose.largest_difference, 0.25, 1e-6);
}

}  // namespace
}  // namespace semblance
