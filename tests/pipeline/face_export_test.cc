#include "semblance/pipeline/face_export.h"

#include <gmock/gmock.h>
#include <tiny_gltf.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <stdexcept>

#include "semblance/core/errors.h"
#include "semblance/core/random.h"
#include "semblance/core/rigid3.h"
#include "semblance/models/face.h"
#include "support.h"

namespace semblance {
namespace {

constexpr int k_rows = 12, k_columns = 10;

PointsF random_points(Random& random, Eigen::Index count, double size_m) {
  PointsF points(count, 3);
  for (Eigen::Index i = 0; i < points.size(); ++i)
    points.data()[i] = static_cast<float>(size_m * random.normal());
  return points;
}

std::shared_ptr<const Mesh> grid_mesh() {
  auto mesh = std::make_shared<Mesh>();
  mesh->positions_m.resize(k_rows * k_columns, 3);
  mesh->uvs.resize(k_rows * k_columns, 2);
  for (int r = 0; r < k_rows; ++r)
    for (int c = 0; c < k_columns; ++c) {
      mesh->positions_m.row(r * k_columns + c) << 0.01 * c, 0.01 * r, 0.001 * r * c;
      mesh->uvs.row(r * k_columns + c) << c / (k_columns - 1.0f), r / (k_rows - 1.0f);
    }
  mesh->triangles.resize(2 * (k_rows - 1) * (k_columns - 1), 3);
  int t = 0;
  for (int r = 0; r + 1 < k_rows; ++r)
    for (int c = 0; c + 1 < k_columns; ++c) {
      const int a = r * k_columns + c, b = a + 1, d = a + k_columns;
      mesh->triangles.row(t++) << a, b, d + 1;
      mesh->triangles.row(t++) << a, d + 1, d;
    }
  return mesh;
}

ParameterBlock scalar(const std::string& name, double lower) {
  return scalar_block(name, "1", lower, 1.0, 0.0, 0.3, name);
}

/// Two identity parameters, two straight expressions (one sparse), one turn about the x axis.
MorphShape example_shape() {
  Random random(4);
  MorphShape shape;
  shape.mesh = grid_mesh();
  shape.parameters = {scalar("face_height", -3.0), scalar("nose_length", -3.0),
                      scalar("jaw_open", 0.0), scalar("mouth_side", -1.0),
                      scalar("eye_turn", -1.0)};
  shape.identity_count = 2;
  const Eigen::Index n = shape.mesh->vertex_count();
  for (int p = 0; p < 4; ++p) {
    MorphField field = make_field(p, random_points(random, n, 0.005));
    if (p == 3) {
      field.vertices = {3, 17, 40};
      field.displacement_m = random_points(random, 3, 0.005);
    }
    shape.fields.push_back(field);
  }
  constexpr double k_turn_rad = 0.6;
  PointsF sine = PointsF::Zero(n, 3), cosine = PointsF::Zero(n, 3);
  for (int v = 0; v < 30; ++v) {
    const Eigen::Vector3d p = shape.mesh->positions_m.row(v);
    sine.row(v) = Eigen::RowVector3d(0, -p.z(), p.y()).cast<float>();
    cosine.row(v) = Eigen::RowVector3d(0, -p.y(), -p.z()).cast<float>();
  }
  MorphField turn_sine = make_field(4, sine), turn_cosine = make_field(4, cosine);
  turn_sine.weight = [](double t) {
    return Weight{std::sin(k_turn_rad * t), k_turn_rad * std::cos(k_turn_rad * t)};
  };
  turn_cosine.weight = [](double t) {
    return Weight{1.0 - std::cos(k_turn_rad * t), k_turn_rad * std::sin(k_turn_rad * t)};
  };
  shape.fields.push_back(turn_sine);
  shape.fields.push_back(turn_cosine);
  return shape;
}

TrackFrame frame_of(int index, double turn) {
  Random random(9, static_cast<std::uint64_t>(index));
  TrackFrame frame;
  frame.frame = index;
  frame.time_s = 0.04 * index;
  frame.status = TrackStatus::tracked;
  const Eigen::Quaterniond q = quaternion_from_rotation_vector(
      {0.5 * random.normal(), 0.5 * random.normal(), 0.5 * random.normal()});
  frame.x.resize(12);
  frame.x << q.w(), q.x(), q.y(), q.z(), 0.1 * random.normal(), 0.1 * random.normal(), -0.5, 0.8,
      -1.2, random.uniform(), random.uniform(-1.0, 1.0), turn;
  return frame;
}

class ReadBack {
 public:
  explicit ReadBack(const std::string& path) {
    tinygltf::TinyGLTF loader;
    std::string error, warning;
    if (!loader.LoadBinaryFromFile(&model, &error, &warning, path)) throw std::runtime_error(error);
    for (const auto& channel : model.animations.at(0).channels) {
      const auto& sampler = model.animations[0].samplers[channel.sampler];
      EXPECT_EQ(sampler.interpolation, "LINEAR");
      times = floats(sampler.input);
      outputs[channel.target_path] = floats(sampler.output);
    }
    const auto& primitive = model.meshes.at(0).primitives.at(0);
    base = floats(primitive.attributes.at("POSITION"));
    for (const auto& target : primitive.targets) targets.push_back(floats(target.at("POSITION")));
    for (const auto& name : model.meshes[0].extras.Get("targetNames").Get<tinygltf::Value::Array>())
      target_names.push_back(name.Get<std::string>());
  }

  /// World positions at one key, as a viewer computes them.
  PointsF positions_at(std::size_t key) const {
    std::vector<float> moved = base;
    for (std::size_t t = 0; t < targets.size(); ++t)
      for (std::size_t i = 0; i < moved.size(); ++i)
        moved[i] += outputs.at("weights")[key * targets.size() + t] * targets[t][i];
    const float* q = &outputs.at("rotation")[4 * key];
    const float* p = &outputs.at("translation")[3 * key];
    const Eigen::Quaternionf rotation(q[3], q[0], q[1], q[2]);
    PointsF out(static_cast<Eigen::Index>(moved.size() / 3), 3);
    for (Eigen::Index v = 0; v < out.rows(); ++v)
      out.row(v) = (rotation * Eigen::Vector3f(&moved[3 * v]) + Eigen::Vector3f(p)).transpose();
    return out;
  }

  tinygltf::Model model;
  std::vector<float> times, base;
  std::vector<std::vector<float>> targets;
  std::vector<std::string> target_names;
  std::map<std::string, std::vector<float>> outputs;

 private:
  std::vector<float> floats(int index) const {
    const auto& accessor = model.accessors.at(index);
    const int width = tinygltf::GetNumComponentsInType(accessor.type);
    std::vector<float> out(accessor.count * width, 0.0f);
    if (accessor.bufferView >= 0) {
      const unsigned char* from = data(accessor.bufferView, accessor.byteOffset);
      std::memcpy(out.data(), from, out.size() * sizeof(float));
    }
    if (accessor.sparse.isSparse) {
      const auto* at = reinterpret_cast<const std::uint32_t*>(
          data(accessor.sparse.indices.bufferView, accessor.sparse.indices.byteOffset));
      const auto* values = reinterpret_cast<const float*>(
          data(accessor.sparse.values.bufferView, accessor.sparse.values.byteOffset));
      for (int i = 0; i < accessor.sparse.count; ++i)
        for (int k = 0; k < width; ++k) out[at[i] * width + k] = values[i * width + k];
    }
    return out;
  }
  const unsigned char* data(int view, std::size_t offset) const {
    const auto& v = model.bufferViews.at(view);
    return model.buffers.at(v.buffer).data.data() + v.byteOffset + offset;
  }
};

Track example_track(double turn) {
  Track track;
  for (int i = 0; i < 10; ++i) {
    track.frames.push_back(frame_of(i, turn));
    if (i == 4 || i == 5) {
      track.frames.back().status = TrackStatus::lost;
      track.frames.back().x.resize(0);
    }
  }
  return track;
}

float largest_distance(const PointsF& a, const PointsF& b) {
  return (a - b).rowwise().norm().maxCoeff();
}

PointsF model_positions(const MorphModel& model, const Eigen::VectorXd& x) {
  Scene scene;
  model.synthesize(x, scene);
  return scene.objects.at(0).positions_m;
}

TEST(FaceExport, KeysEqualTheModelForStraightFields) {
  const testing::TemporaryFolder folder;
  const std::string path = (folder.path() / "face.glb").string();
  const MorphShape shape = example_shape();
  const Track track = example_track(0.0);
  write_face_glb(path, shape, {}, track);
  const ReadBack file(path);
  EXPECT_THAT(file.target_names,
              ::testing::ElementsAre("jaw_open", "mouth_side", "eye_turn", "eye_turn_negative"));
  const MorphModel model(shape);
  std::size_t key = 0;
  for (const TrackFrame& frame : track.frames) {
    if (frame.frame == 4) continue;  // lost, and without a key
    ASSERT_LT(key, file.times.size());
    EXPECT_NEAR(file.times[key], frame.time_s, 1e-6);
    // The key of frame 5, the last lost one, holds frame 3.
    const Eigen::VectorXd& x = frame.frame == 5 ? track.frames[3].x : frame.x;
    EXPECT_LT(largest_distance(file.positions_at(key), model_positions(model, x)), 1e-4);
    ++key;
  }
  EXPECT_EQ(key, file.times.size());
}

TEST(FaceExport, EndsOfCurvedFieldsAreExactAndTheRestIsAsStated) {
  const testing::TemporaryFolder folder;
  const std::string path = (folder.path() / "face.glb").string();
  const MorphShape shape = example_shape();
  const MorphModel model(shape);
  const double stated_m = blend_deviation_m(shape, 4);
  EXPECT_GT(stated_m, 1e-5);
  EXPECT_LT(stated_m, 0.005);
  for (const double turn : {-1.0, -0.5, 0.3, 0.5, 0.8, 1.0}) {
    const Track track = example_track(turn);
    write_face_glb(path, shape, {}, track);
    const ReadBack file(path);
    const float distance_m =
        largest_distance(file.positions_at(0), model_positions(model, track.frames[0].x));
    EXPECT_LT(distance_m, std::abs(turn) == 1.0 ? 1e-6 : 1.02 * stated_m + 1e-6);
  }
  for (int p = 0; p < 4; ++p) EXPECT_LT(blend_deviation_m(shape, p), 1e-7);
}

TEST(FaceExport, BuiltInFaceDeviatesAsStated) {
  const MorphShape face = make_sweep_face();
  for (int p = face.identity_count; p < static_cast<int>(face.parameters.size()); ++p)
    EXPECT_LT(blend_deviation_m(face, p), 0.0025) << face.parameters[p].name;
}

TEST(FaceExport, CarriesTheTexture) {
  const testing::TemporaryFolder folder;
  const std::string path = (folder.path() / "face.glb").string();
  write_face_glb(path, example_shape(), Image(8, 4, 3, 0.5f), example_track(0.0));
  const ReadBack file(path);
  ASSERT_EQ(file.model.images.size(), 1u);
  EXPECT_EQ(file.model.images[0].mimeType, "image/png");
}

TEST(FaceExport, RefusesATrackThatDoesNotFit) {
  const testing::TemporaryFolder folder;
  const std::string path = (folder.path() / "face.glb").string();
  Track track = example_track(0.0);
  track.frames[2].x.conservativeResize(9);
  EXPECT_THROW(write_face_glb(path, example_shape(), {}, track), InvalidInput);
  for (TrackFrame& frame : track.frames) frame.status = TrackStatus::lost;
  EXPECT_THROW(write_face_glb(path, example_shape(), {}, track), InvalidInput);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace semblance
