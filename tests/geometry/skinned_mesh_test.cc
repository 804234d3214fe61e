// Skinning and animation, against closed forms.
#include "semblance/geometry/skinned_mesh.h"

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

Quaterniond about_z(double angle_rad) {
  return Quaterniond(Eigen::AngleAxisd(angle_rad, Vector3d::UnitZ()));
}

Eigen::RowVector4d xyzw(const Quaterniond& q) { return q.coeffs().transpose(); }

/// A triangle of which each corner hangs on both joints; the second joint is 1 m above the first.
SkinnedMesh two_bones() {
  SkinnedMesh skin;
  skin.mesh.positions_m.resize(3, 3);
  skin.mesh.positions_m << 0.1, 0.5, 0.2, -0.3, 1.5, 0.0, 0.2, 2.0, 0.4;
  skin.mesh.triangles.resize(1, 3);
  skin.mesh.triangles << 0, 1, 2;
  skin.nodes.resize(2);
  skin.nodes[1] = {"upper", 0, {{0.0, 1.0, 0.0}, Quaterniond::Identity(), Vector3d::Ones()}};
  skin.joints.resize(2);
  skin.joints[1].node = 1;
  skin.joints[1].joint_from_mesh.translation() = Vector3d(0.0, -1.0, 0.0);
  skin.weights.resize(3, 2);
  for (int v = 0; v < 3; ++v) {
    skin.weights.insert(v, 0) = 1.0 - 0.25 * (v + 1);
    skin.weights.insert(v, 1) = 0.25 * (v + 1);
  }
  return skin;
}

AnimationChannel channel_of(NodeProperty property, Interpolation interpolation,
                            std::vector<double> times_s, const Eigen::MatrixXd& values) {
  return {1, property, interpolation, std::move(times_s), values};
}

TEST(SkinnedMesh, BendsByTheWeightedMeanOfItsJoints) {
  const SkinnedMesh skin = two_bones();
  EXPECT_NO_THROW(validate(skin, "test"));
  SkinPose pose = rest_pose(skin.nodes);
  EXPECT_TRUE(skinned_positions(skin, pose).isApprox(skin.mesh.positions_m, 1e-15));
  const double angle = 0.7, c = std::cos(angle), s = std::sin(angle);
  pose[1].rotation = about_z(angle);
  const auto bent = skinned_positions(skin, pose);
  for (int v = 0; v < 3; ++v) {
    const Vector3d p = skin.mesh.positions_m.row(v);
    const Vector3d turned(c * p.x() - s * (p.y() - 1.0), 1.0 + s * p.x() + c * (p.y() - 1.0),
                          p.z());
    const double w = 0.25 * (v + 1);
    EXPECT_LT((Vector3d(bent.row(v)) - (1.0 - w) * p - w * turned).norm(), 1e-15);
  }
}

/// A child's point is scaled, turned and moved by its own transform first, then by its parent's.
TEST(SkinnedMesh, TransformsGoFromTheLeavesToTheRoot) {
  std::vector<SkinNode> nodes(2);
  nodes[0].rest = {{1.0, 2.0, 3.0}, about_z(0.5 * M_PI), {2.0, 1.0, 1.0}};
  nodes[1] = {"", 0, {{0.0, 1.0, 0.0}, about_z(M_PI), {1.0, 3.0, 5.0}}};
  const auto world = world_from_nodes(nodes, rest_pose(nodes));
  // (1, 1, 1) -> (1, 3, 5) -> (-1, -3, 5) -> (-1, -2, 5) -> (-2, -2, 5) -> (2, -2, 5) -> (3, 0, 8)
  EXPECT_LT((world[1] * Vector3d(1, 1, 1) - Vector3d(3, 0, 8)).norm(), 1e-14);
}

TEST(SkinAnimation, TurnsSteadilyOnTheShorterArc) {
  const SkinnedMesh skin = two_bones();
  const Vector3d axis = Vector3d(1, 2, -2) / 3.0;
  const auto turned = [&](double angle) { return Quaterniond(Eigen::AngleAxisd(angle, axis)); };
  Eigen::MatrixXd values(3, 4);
  values << xyzw(turned(0.2)), -xyzw(turned(1.4)),
      xyzw(turned(1.4));  // the second is the other sign
  SkinAnimation animation{
      "turn", {channel_of(NodeProperty::rotation, Interpolation::linear, {0.5, 2.5, 3.0}, values)}};
  for (const double t : {0.5, 0.9, 1.7, 2.5}) {
    const SkinPose pose = animated_pose(skin.nodes, animation, t);
    EXPECT_LT(pose[1].rotation.angularDistance(turned(0.2 + 1.2 * (t - 0.5) / 2.0)), 1e-12) << t;
  }
  EXPECT_LT(animated_pose(skin.nodes, animation, 2.8)[1].rotation.angularDistance(turned(1.4)),
            1e-12);
  EXPECT_EQ(animation.end_s(), 3.0);
}

TEST(SkinAnimation, StaysAtItsEnds) {
  const SkinnedMesh skin = two_bones();
  Eigen::MatrixXd values(2, 3);
  values << 1, 2, 3, 5, 6, 7;
  for (const auto kind : {Interpolation::step, Interpolation::linear}) {
    const SkinAnimation animation{
        "move", {channel_of(NodeProperty::translation, kind, {1.0, 2.0}, values)}};
    const auto at = [&](double t) {
      return animated_pose(skin.nodes, animation, t)[1].translation_m;
    };
    EXPECT_EQ(at(-1.0), Vector3d(1, 2, 3));
    EXPECT_EQ(at(1.0), Vector3d(1, 2, 3));
    EXPECT_EQ(at(1.25), kind == Interpolation::step ? Vector3d(1, 2, 3) : Vector3d(2, 3, 4));
    EXPECT_EQ(at(2.0), Vector3d(5, 6, 7));
    EXPECT_EQ(at(9.0), Vector3d(5, 6, 7));
  }
}

/// Three keys of a cubic with its derivatives, at uneven times, give that cubic.
TEST(SkinAnimation, CubicSplinesReproduceCubics) {
  const SkinnedMesh skin = two_bones();
  const Vector3d a(1, -2, 0.5), b(0.3, 1, 2), c(-1, 0.7, 0.1), d(0.4, -0.2, 0.9);
  const auto value = [&](double t) { return Vector3d(a + t * (b + t * (c + t * d))); };
  const auto slope = [&](double t) { return Vector3d(b + t * (2.0 * c + t * 3.0 * d)); };
  const std::vector<double> times_s{0.2, 0.9, 3.0};
  Eigen::MatrixXd values(9, 3);
  for (int k = 0; k < 3; ++k) {
    values.row(3 * k) = values.row(3 * k + 2) = slope(times_s[k]);
    values.row(3 * k + 1) = value(times_s[k]);
  }
  const SkinAnimation animation{
      "grow", {channel_of(NodeProperty::scale, Interpolation::cubic_spline, times_s, values)}};
  for (const double t : {0.2, 0.5, 0.9, 1.1, 2.7, 3.0}) {
    EXPECT_LT((animated_pose(skin.nodes, animation, t)[1].scale - value(t)).norm(), 1e-12) << t;
  }
  EXPECT_LT((animated_pose(skin.nodes, animation, 0.0)[1].scale - value(0.2)).norm(), 1e-12);
  EXPECT_LT((animated_pose(skin.nodes, animation, 4.0)[1].scale - value(3.0)).norm(), 1e-12);
}

/// The same curve by de Casteljau's construction, which knows no Hermite polynomials; the slopes
/// before and after a key differ.
TEST(SkinAnimation, CubicSplinesOfRotationsAreMadeUnit) {
  const SkinnedMesh skin = two_bones();
  Eigen::MatrixXd values = Eigen::MatrixXd::Zero(6, 4);
  values.row(1) = xyzw(about_z(0.3));
  values.row(2) << 0.1, 0.5, -0.2, 0.3;  // after the first key
  values.row(3) << -0.4, 0.2, 0.3, 0.1;  // before the second
  values.row(4) = xyzw(Quaterniond(Eigen::AngleAxisd(1.1, Vector3d::UnitX())));
  const SkinAnimation animation{
      "turn",
      {channel_of(NodeProperty::rotation, Interpolation::cubic_spline, {1.0, 1.5}, values)}};
  for (const double fraction : {0.1, 0.5, 0.8}) {
    std::array<Eigen::RowVector4d, 4> points{
        values.row(1), values.row(1) + values.row(2) * 0.5 / 3.0,
        values.row(4) - values.row(3) * 0.5 / 3.0, values.row(4)};
    for (int count = 3; count > 0; --count) {
      for (int i = 0; i < count; ++i) {
        points[i] = (1.0 - fraction) * points[i] + fraction * points[i + 1];
      }
    }
    const Quaterniond q = animated_pose(skin.nodes, animation, 1.0 + 0.5 * fraction)[1].rotation;
    EXPECT_LT((xyzw(q) - points[0].normalized()).norm(), 1e-14) << fraction;
  }
}

TEST(SkinAnimation, LeavesOtherPropertiesAtRest) {
  SkinnedMesh skin = two_bones();
  skin.nodes[1].rest.scale = {2, 2, 2};
  Eigen::MatrixXd values(1, 3);
  values << 4, 5, 6;
  const SkinAnimation animation{
      "move", {channel_of(NodeProperty::translation, Interpolation::linear, {0.0}, values)}};
  const SkinPose pose = animated_pose(skin.nodes, animation, 1.0);
  EXPECT_EQ(pose[1].translation_m, Vector3d(4, 5, 6));
  EXPECT_EQ(pose[1].scale, Vector3d(2, 2, 2));
  EXPECT_EQ(pose[0].translation_m, Vector3d::Zero());
}

/// A cube with a vertex of its own for every corner of every face, as files with hard edges have
/// it.
SkinnedMesh cube_of_faces() {
  SkinnedMesh skin;
  skin.nodes.resize(1);
  skin.joints.resize(1);
  skin.mesh.positions_m.resize(24, 3);
  skin.mesh.triangles.resize(12, 3);
  skin.mesh.uvs.setZero(24, 2);
  skin.weights.resize(24, 1);
  for (int face = 0; face < 6; ++face) {
    const int axis = face / 2;
    const double side = face % 2 == 0 ? 1.0 : -1.0;
    for (int corner = 0; corner < 4; ++corner) {
      const double s = corner == 0 || corner == 3 ? 1.0 : -1.0, t = corner < 2 ? 1.0 : -1.0;
      skin.mesh.positions_m(4 * face + corner, axis) = side;
      skin.mesh.positions_m(4 * face + corner, (axis + 1) % 3) = s;
      skin.mesh.positions_m(4 * face + corner, (axis + 2) % 3) = t * side;
      skin.weights.insert(4 * face + corner, 0) = 1.0;
    }
    skin.mesh.triangles.row(2 * face) << 4 * face, 4 * face + 1, 4 * face + 2;
    skin.mesh.triangles.row(2 * face + 1) << 4 * face, 4 * face + 2, 4 * face + 3;
  }
  return skin;
}

TEST(WithoutSeams, ACubeOfFacesIsClosed) {
  const SkinnedMesh cube = without_seams(cube_of_faces());
  EXPECT_NO_THROW(validate(cube, "cube"));
  EXPECT_EQ(cube.mesh.vertex_count(), 8);
  EXPECT_EQ(cube.mesh.triangle_count(), 12);
  EXPECT_EQ(cube.mesh.uvs.rows(), 0);
  std::map<std::pair<int, int>, int> uses;
  for (Eigen::Index t = 0; t < 12; ++t) {
    for (int k = 0; k < 3; ++k) {
      ++uses[{cube.mesh.triangles(t, k), cube.mesh.triangles(t, (k + 1) % 3)}];
    }
  }
  EXPECT_EQ(uses.size(), 36u);  // each edge once in either direction
  for (const auto& [edge, count] : uses) {
    EXPECT_EQ(count, 1);
    EXPECT_EQ(uses.count({edge.second, edge.first}), 1u);
  }
}

TEST(WithoutSeams, KeepsApartWhatMovesApart) {
  SkinnedMesh cube = cube_of_faces();
  cube.nodes.resize(2);
  cube.joints = {{0, Eigen::Affine3d::Identity()}, {1, Eigen::Affine3d::Identity()}};
  cube.weights.resize(24, 2);
  for (int v = 0; v < 24; ++v) cube.weights.insert(v, v < 4 ? 1 : 0) = 1.0;  // the first face
  const SkinnedMesh parted = without_seams(cube);
  EXPECT_EQ(parted.mesh.vertex_count(), 12);
  SkinPose pose = rest_pose(parted.nodes);
  pose[1].translation_m = {5, 0, 0};
  EXPECT_EQ((skinned_positions(parted, pose).col(0).array() == 6.0).count(), 4);
}

TEST(WithoutSeams, DropsTrianglesWithoutArea) {
  SkinnedMesh skin = two_bones();
  skin.mesh.positions_m.row(2) = skin.mesh.positions_m.row(1);
  skin.weights = Eigen::SparseMatrix<double, Eigen::RowMajor>(3, 2);
  for (int v = 0; v < 3; ++v) skin.weights.insert(v, 0) = 1.0;
  EXPECT_EQ(without_seams(skin).mesh.triangle_count(), 0);
}

TEST(SkinnedMesh, IsRefusedWhereItDoesNotFitTogether) {
  const auto expect_refused = [](const auto& spoil, const char* message) {
    SkinnedMesh skin = two_bones();
    Eigen::MatrixXd values(1, 4);
    values << 0, 0, 0, 1;
    skin.animations = {
        {"turn", {channel_of(NodeProperty::rotation, Interpolation::linear, {0.0}, values)}}};
    EXPECT_NO_THROW(validate(skin, "body"));
    spoil(skin);
    EXPECT_THAT([&] { validate(skin, "body"); }, ThrowsMessage<InvalidInput>(::testing::AllOf(
                                                     HasSubstr("body"), HasSubstr(message))));
  };
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const auto channel = [](SkinnedMesh& skin) -> AnimationChannel& {
    return skin.animations[0].channels[0];
  };
  expect_refused([&](SkinnedMesh& s) { s.mesh.positions_m(1, 1) = nan; }, "vertex 1");
  expect_refused([](SkinnedMesh& s) { s.nodes[0].parent = 1; }, "node 0");
  expect_refused([](SkinnedMesh& s) { s.nodes[1].rest.rotation.w() = 2.0; }, "unit");
  expect_refused([&](SkinnedMesh& s) { s.nodes[1].rest.scale.x() = nan; }, "'upper'");
  expect_refused([](SkinnedMesh& s) { s.joints[1].node = 2; }, "joint 1 is node 2");
  expect_refused([&](SkinnedMesh& s) { s.joints[0].joint_from_mesh(0, 3) = nan; }, "joint 0");
  expect_refused([](SkinnedMesh& s) { s.joints.pop_back(); }, "column per joint");
  expect_refused([](SkinnedMesh& s) { s.weights.coeffRef(2, 0) = 0.5; }, "vertex 2");
  expect_refused([&](SkinnedMesh& s) { s.weights.coeffRef(1, 0) = nan; }, "vertex 1");
  expect_refused([&](SkinnedMesh& s) { channel(s).node = 7; }, "'turn', channel 0");
  expect_refused([&](SkinnedMesh& s) { channel(s).times_s = {0.0, 1.0}; }, "for 2 keys");
  expect_refused([&](SkinnedMesh& s) { channel(s).values.setZero(); }, "key 0 is zero");
  expect_refused([&](SkinnedMesh& s) { channel(s).values(0, 0) = nan; }, "not finite");
  expect_refused(
      [&](SkinnedMesh& s) {
        channel(s).times_s = {1.0, 1.0};
        channel(s).values = channel(s).values.replicate(2, 1).eval();
      },
      "ascend");
}

}  // namespace
}  // namespace semblance
