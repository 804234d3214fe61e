// Files are read back by tinygltf, which shares no code with the writer.
#include "semblance/io/gltf_writer.h"

#include <gmock/gmock.h>
#include <tiny_gltf.h>

#include <cmath>
#include <cstring>

#include "files.h"
#include "semblance/core/errors.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::HasSubstr;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;

GltfScene some_scene() {
  GltfScene scene;
  constexpr int side = 4;
  scene.mesh.positions_m.resize(side * side, 3);
  scene.mesh.uvs.resize(side * side, 2);
  for (int i = 0; i < side * side; ++i) {
    scene.mesh.positions_m.row(i) << 0.1 * (i % side), 0.1 * (i / side), -0.01 * i;
    scene.mesh.uvs.row(i) << 0.25f * static_cast<float>(i % side),
        0.2f * static_cast<float>(i / side);
  }
  scene.mesh.triangles.resize(2, 3);
  scene.mesh.triangles << 0, 1, 5, 10, 11, 15;
  scene.texture = Rgb8{2, 2, {255, 0, 0, 0, 255, 0, 0, 0, 255, 9, 8, 7}};
  PointsF sparse(2, 3), dense = PointsF::Constant(side * side, 3, 0.25f);
  sparse << 1, 2, 3, 4, 5, 6;
  std::vector<int> all(side * side);
  for (int i = 0; i < side * side; ++i) all[i] = i;
  scene.targets = {
      {"jaw_open", {3, 9}, sparse}, {"smile", all, dense}, {"unmoved", {}, PointsF(0, 3)}};
  for (int i = 0; i < 3; ++i) {
    GltfKey key;
    key.time_s = 0.04 * i;
    key.world_from_model.rotation =
        Eigen::AngleAxisd(3.0 + 0.2 * i, Eigen::Vector3d::UnitY()) * Eigen::Quaterniond::Identity();
    if (i == 1) key.world_from_model.rotation.coeffs() *= -1;
    key.world_from_model.translation_m = Eigen::Vector3d(0, 0.1 * i, -0.5);
    key.weights = {0.1f * static_cast<float>(i), 0.5f, 0.0f};
    scene.animation.push_back(key);
  }
  return scene;
}

class WrittenGltf : public ::testing::Test {
 protected:
  void SetUp() override {
    const std::string path = folder_.path() / "face.glb";
    write_glb(path, some_scene());
    tinygltf::TinyGLTF loader;
    loader.SetImageLoader(
        [](tinygltf::Image* image, const int, std::string*, std::string*, int, int,
           const unsigned char* bytes, int size, void*) {
          image->image.assign(bytes, bytes + size);
          return true;
        },
        nullptr);
    std::string error, warning;
    ASSERT_TRUE(loader.LoadBinaryFromFile(&model_, &error, &warning, path)) << error;
    EXPECT_EQ(error + warning, "");
  }

  std::vector<float> floats(int accessor_index) const {
    const tinygltf::Accessor& accessor = model_.accessors[accessor_index];
    const int width = tinygltf::GetNumComponentsInType(accessor.type);
    std::vector<float> values(accessor.count * width, 0.0f);
    if (accessor.bufferView >= 0) {
      std::memcpy(values.data(), bytes(accessor.bufferView), values.size() * sizeof(float));
    }
    for (int i = 0; accessor.sparse.isSparse && i < accessor.sparse.count; ++i) {
      std::uint32_t row = 0;
      std::memcpy(&row, bytes(accessor.sparse.indices.bufferView) + 4 * i, 4);
      std::memcpy(&values[row * width], bytes(accessor.sparse.values.bufferView) + 4 * width * i,
                  4 * width);
    }
    return values;
  }

  const unsigned char* bytes(int view_index) const {
    const tinygltf::BufferView& view = model_.bufferViews[view_index];
    EXPECT_EQ(view.byteOffset % 4, 0u);
    return model_.buffers[view.buffer].data.data() + view.byteOffset;
  }

  TemporaryFolder folder_;
  tinygltf::Model model_;
};

TEST_F(WrittenGltf, HasTheMesh) {
  const GltfScene scene = some_scene();
  ASSERT_EQ(model_.meshes.size(), 1u);
  const tinygltf::Primitive& primitive = model_.meshes[0].primitives.at(0);
  const auto positions = floats(primitive.attributes.at("POSITION"));
  const auto uvs = floats(primitive.attributes.at("TEXCOORD_0"));
  const auto normals = floats(primitive.attributes.at("NORMAL"));
  for (int i = 0; i < 16; ++i) {
    for (int k = 0; k < 3; ++k) {
      EXPECT_FLOAT_EQ(positions[3 * i + k], static_cast<float>(scene.mesh.positions_m(i, k)));
    }
    EXPECT_FLOAT_EQ(uvs[2 * i], scene.mesh.uvs(i, 0));
    EXPECT_FLOAT_EQ(uvs[2 * i + 1], 1.0f - scene.mesh.uvs(i, 1)) << "v runs down in glTF";
    const Eigen::Map<const Eigen::Vector3f> normal(&normals[3 * i]);
    EXPECT_NEAR(normal.norm(), 1.0f, 1e-5f);
  }
  std::vector<std::uint32_t> indices(6);
  std::memcpy(indices.data(), bytes(model_.accessors[primitive.indices].bufferView), 24);
  EXPECT_THAT(indices, ::testing::ElementsAre(0, 1, 5, 10, 11, 15));
}

TEST_F(WrittenGltf, StatesTheBoundsOfPositions) {
  const tinygltf::Primitive& primitive = model_.meshes[0].primitives.at(0);
  std::vector<int> accessors = {primitive.attributes.at("POSITION")};
  for (const auto& target : primitive.targets) accessors.push_back(target.at("POSITION"));
  for (int index : accessors) {
    const auto values = floats(index);
    for (int k = 0; k < 3; ++k) {
      float low = values[k], high = values[k];
      for (std::size_t i = k; i < values.size(); i += 3) {
        low = std::min(low, values[i]);
        high = std::max(high, values[i]);
      }
      EXPECT_FLOAT_EQ(static_cast<float>(model_.accessors[index].minValues.at(k)), low);
      EXPECT_FLOAT_EQ(static_cast<float>(model_.accessors[index].maxValues.at(k)), high);
    }
  }
}

TEST_F(WrittenGltf, HasNamedMorphTargets) {
  const tinygltf::Mesh& mesh = model_.meshes[0];
  const auto& targets = mesh.primitives.at(0).targets;
  ASSERT_EQ(targets.size(), 3u);
  EXPECT_EQ(mesh.weights.size(), 3u);
  EXPECT_EQ(mesh.extras.Get("targetNames").Get(0).Get<std::string>(), "jaw_open");
  const auto sparse = floats(targets[0].at("POSITION"));
  EXPECT_TRUE(model_.accessors[targets[0].at("POSITION")].sparse.isSparse);
  for (int i = 0; i < 48; ++i) {
    const float expected = i / 3 == 3 ? 1.0f + i % 3 : i / 3 == 9 ? 4.0f + i % 3 : 0.0f;
    EXPECT_EQ(sparse[i], expected);
  }
  EXPECT_THAT(floats(targets[1].at("POSITION")), ::testing::Each(0.25f));
  EXPECT_THAT(floats(targets[2].at("POSITION")), ::testing::Each(0.0f));
}

TEST_F(WrittenGltf, EmbedsTheTexture) {
  ASSERT_EQ(model_.images.size(), 1u);
  EXPECT_EQ(model_.images[0].mimeType, "image/png");
  const auto& image = model_.images[0].image;
  const std::string path = folder_.path() / "texture.png";
  testing::write_text(path, std::string(image.begin(), image.end()));
  EXPECT_EQ(read_image_rgb8(path).data, some_scene().texture->data);
  EXPECT_EQ(model_.materials.at(0).pbrMetallicRoughness.baseColorTexture.index, 0);
}

TEST_F(WrittenGltf, AnimatesPoseAndWeights) {
  const GltfScene scene = some_scene();
  ASSERT_EQ(model_.animations.size(), 1u);
  const tinygltf::Animation& animation = model_.animations[0];
  ASSERT_EQ(animation.channels.size(), 3u);
  for (const tinygltf::AnimationChannel& channel : animation.channels) {
    const tinygltf::AnimationSampler& sampler = animation.samplers[channel.sampler];
    const auto times = floats(sampler.input), values = floats(sampler.output);
    EXPECT_FLOAT_EQ(times[2], 0.08f);
    for (int i = 0; i < 3; ++i) {
      const GltfKey& key = scene.animation[i];
      if (channel.target_path == "translation") {
        EXPECT_FLOAT_EQ(values[3 * i + 1],
                        static_cast<float>(key.world_from_model.translation_m.y()));
      } else if (channel.target_path == "weights") {
        EXPECT_FLOAT_EQ(values[3 * i], key.weights[0]);
        EXPECT_FLOAT_EQ(values[3 * i + 1], key.weights[1]);
      } else {
        ASSERT_EQ(channel.target_path, "rotation");
        const Eigen::Quaternionf q(values[4 * i + 3], values[4 * i], values[4 * i + 1],
                                   values[4 * i + 2]);
        EXPECT_NEAR(q.cast<double>().angularDistance(key.world_from_model.rotation), 0.0, 1e-3);
        if (i == 0) continue;
        const Eigen::Quaternionf before(values[4 * i - 1], values[4 * i - 4], values[4 * i - 3],
                                        values[4 * i - 2]);
        EXPECT_GT(q.dot(before), 0.0f) << "neighbouring keys go the short way";
      }
    }
  }
}

TEST(GltfWriter, RejectsWhatDoesNotFit) {
  const TemporaryFolder folder;
  const auto refuse = [&](auto damage, const char* message) {
    GltfScene scene = some_scene();
    damage(scene);
    EXPECT_THAT([&] { write_glb(folder.path() / "face.glb", scene); },
                ThrowsMessage<InvalidInput>(HasSubstr(message)));
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
  };
  refuse([](GltfScene& s) { s.animation[1].time_s = 0; }, "later time");
  refuse([](GltfScene& s) { s.animation[1].weights.pop_back(); }, "3 finite weights");
  refuse([](GltfScene& s) { s.animation[1].weights[0] = NAN; }, "finite weights");
  refuse([](GltfScene& s) { s.targets[0].vertices[1] = 99; }, "'jaw_open'");
  refuse([](GltfScene& s) { s.mesh.uvs.resize(0, 2); }, "texture needs");
}

}  // namespace
}  // namespace semblance
