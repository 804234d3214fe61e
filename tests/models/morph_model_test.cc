#include "semblance/models/morph_model.h"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <limits>

#include "semblance/core/errors.h"
#include "semblance/core/random.h"
#include "semblance/models/contract.h"
#include "small_face.h"

namespace semblance {
namespace {

using ::testing::HasSubstr;
using testing::small_face;
using ::testing::ThrowsMessage;

Eigen::VectorXd some_x(const MorphModel& model, Random& random) {
  Eigen::VectorXd x = model.parameters().initial();
  x.head<4>() = random.normal_vector(4).normalized();
  x.segment<3>(4) = random.normal_vector(3);
  for (Eigen::Index i = 7; i < x.size(); ++i) x[i] = random.uniform(0.1, 0.9);
  return x;
}

TEST(MorphModel, MeetsTheContract) { EXPECT_MODEL_CONTRACT(MorphModel(small_face())); }

TEST(MorphModel, PlacesEachVertexByTheFormula) {
  const MorphModel model(small_face());
  Random random(3);
  const Eigen::VectorXd x = some_x(model, random);
  const Eigen::Quaterniond q(x[0], x[1], x[2], x[3]);
  Scene scene;
  model.synthesize(x, scene);
  for (int v = 0; v < model.shape().mesh->vertex_count(); ++v) {
    Eigen::Vector3d p = model.shape().mesh->positions_m.row(v);
    for (const MorphField& field : model.shape().fields) {
      const double t = x[7 + field.parameter];
      const double weight = field.weight ? field.weight(t).value : t;
      for (std::size_t i = 0; i < field.vertices.size(); ++i) {
        if (field.vertices[i] != v) continue;
        p += weight * field.displacement_m.row(static_cast<Eigen::Index>(i)).cast<double>();
      }
    }
    const Eigen::Vector3d expected = q * p + x.segment<3>(4);
    const Eigen::Vector3d found = scene.objects[0].positions_m.row(v).cast<double>();
    EXPECT_LT((found - expected).norm(), 1e-6) << "vertex " << v;
  }
}

TEST(MorphModel, NormalsTurnWithTheModel) {
  const MorphModel model(small_face());
  Eigen::VectorXd x = model.parameters().initial();
  Scene straight, turned;
  model.synthesize(x, straight);
  x.head<4>() << 0.5, 0.5, 0.5, 0.5;
  model.synthesize(x, turned);
  const Eigen::Matrix3f rotation =
      Eigen::Quaterniond(0.5, 0.5, 0.5, 0.5).toRotationMatrix().cast<float>();
  const PointsF expected = straight.objects[0].normals * rotation.transpose();
  EXPECT_LT((turned.objects[0].normals - expected).cwiseAbs().maxCoeff(), 1e-5f);
}

TEST(MorphModel, ParametersComeAfterThePose) {
  const MorphModel model(small_face());
  EXPECT_EQ(model.parameters().size(), 4 + 3 + 4);
  EXPECT_EQ(model.parameters().tangent_size(), 3 + 3 + 4);
  EXPECT_EQ(model.parameters().block_index("bend"), MorphModel::first_shape_block + 1);
}

TEST(WithIdentity, IsTheSameFaceWithoutTheParameters) {
  const MorphShape whole = small_face();
  const MorphShape fixed = with_identity(whole, Eigen::VectorXd::Constant(1, 1.7));
  EXPECT_EQ(fixed.identity_count, 0);
  ASSERT_EQ(fixed.parameters.size(), 3u);
  EXPECT_EQ(fixed.parameters[0].name, "bend");
  const PointsF expected = shape_positions(whole, Eigen::Vector4d(1.7, 0.4, 0.6, -0.3));
  const PointsF found = shape_positions(fixed, Eigen::Vector3d(0.4, 0.6, -0.3));
  EXPECT_LT((found - expected).cwiseAbs().maxCoeff(), 1e-7f);
  EXPECT_MODEL_CONTRACT(MorphModel(fixed));
}

TEST(WithIdentity, WantsOneValuePerParameter) {
  EXPECT_THAT([] { with_identity(small_face(), Eigen::VectorXd::Zero(2)); },
              ThrowsMessage<InvalidInput>(HasSubstr("2 values given for 1")));
}

TEST(Landmarks, LieAtTheirBarycentricPlace) {
  const MorphModel model(small_face());
  Scene scene;
  model.synthesize(model.parameters().initial(), scene);
  const Mesh& mesh = *model.shape().mesh;
  const Eigen::Vector3d expected = 0.2 * mesh.positions_m.row(mesh.triangles(5, 0)) +
                                   0.3 * mesh.positions_m.row(mesh.triangles(5, 1)) +
                                   0.5 * mesh.positions_m.row(mesh.triangles(5, 2));
  EXPECT_LT((landmark_position(model.landmarks()[1], scene) - expected).norm(), 1e-7);
  EXPECT_THROW(landmark_position({"far", 1000, {1, 0, 0}}, scene), InvalidInput);
}

TEST(Landmarks, AreNumberedThroughTheScene) {
  const MorphModel model(small_face());
  Scene scene;
  model.synthesize(model.parameters().initial(), scene);
  scene.objects.push_back(scene.objects[0]);
  scene.objects[1].positions_m.array() += 1.0f;
  const int triangles = static_cast<int>(model.shape().mesh->triangle_count());
  const ModelLandmark second{"second", triangles, {1, 0, 0}};
  const Eigen::Vector3d first = landmark_position({"first", 0, {1, 0, 0}}, scene);
  EXPECT_LT((landmark_position(second, scene) - first - Eigen::Vector3d::Ones()).norm(), 1e-6);
  EXPECT_EQ(landmark_vertices(second, scene)[0], model.shape().mesh->vertex_count());
}

TEST(MakeField, KeepsOnlyWhatMoves) {
  PointsF displacement = PointsF::Zero(4, 3);
  displacement(1, 2) = 1e-3f;
  displacement(3, 0) = 1e-7f;
  const MorphField field = make_field(2, displacement, 1e-6f);
  EXPECT_EQ(field.parameter, 2);
  EXPECT_THAT(field.vertices, ::testing::ElementsAre(1));
  EXPECT_FLOAT_EQ(field.displacement_m(0, 2), 1e-3f);
}

struct BadShape {
  const char* name;
  void (*damage)(MorphShape&);
  const char* message;
};

class MorphModelRejects : public ::testing::TestWithParam<BadShape> {};

TEST_P(MorphModelRejects, AShapeThatDoesNotFit) {
  MorphShape shape = small_face();
  GetParam().damage(shape);
  EXPECT_THAT([&] { MorphModel model(shape); },
              ThrowsMessage<InvalidInput>(HasSubstr(GetParam().message)));
}

INSTANTIATE_TEST_SUITE_P(
    All, MorphModelRejects,
    ::testing::Values(
        BadShape{"Parameter", [](MorphShape& s) { s.fields[0].parameter = 9; }, "parameter 9"},
        BadShape{"Vertex", [](MorphShape& s) { s.fields[3].vertices[0] = 20; }, "vertex 20"},
        BadShape{"Order",
                 [](MorphShape& s) { std::swap(s.fields[4].vertices[0], s.fields[4].vertices[1]); },
                 "ascending"},
        BadShape{"Count", [](MorphShape& s) { s.fields[1].vertices.pop_back(); }, "displacements"},
        BadShape{"Finite",
                 [](MorphShape& s) {
                   s.fields[1].displacement_m(0, 0) = std::numeric_limits<float>::quiet_NaN();
                 },
                 "not finite"},
        BadShape{"Landmark", [](MorphShape& s) { s.landmarks[0].triangle = -1; },
                 "landmark 'corner'"},
        BadShape{"Barycentric",
                 [](MorphShape& s) {
                   s.landmarks[0].barycentric = {0, 0, 0};
                 },
                 "landmark 'corner'"},
        BadShape{"Part", [](MorphShape& s) { s.part.pop_back(); }, "parts are given for 19 of 20"},
        BadShape{"Identity", [](MorphShape& s) { s.identity_count = 5; }, "identity_count"},
        BadShape{"Mesh", [](MorphShape& s) { s.mesh.reset(); }, "no mesh"}),
    [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace semblance
