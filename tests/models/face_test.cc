#include "semblance/models/face.h"

#include <gmock/gmock.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <string>

#include "semblance/core/errors.h"
#include "semblance/core/random.h"
#include "semblance/models/contract.h"

namespace semblance {
namespace {

using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
using Values = std::map<std::string, double>;

const MorphShape& face() {
  static const MorphShape shape = make_sweep_face();
  return shape;
}

FacePart part(int vertex) { return static_cast<FacePart>(face().part[vertex]); }
bool is_eye(int vertex) {
  return part(vertex) == FacePart::sclera || part(vertex) == FacePart::iris ||
         part(vertex) == FacePart::pupil;
}

Points posed(const Values& values) {
  const MorphShape& shape = face();
  Points points = shape.mesh->positions_m;
  for (const MorphField& field : shape.fields) {
    const auto found = values.find(shape.parameters[field.parameter].name);
    if (found == values.end()) continue;
    const double w = field.weight ? field.weight(found->second).value : found->second;
    for (std::size_t i = 0; i < field.vertices.size(); ++i) {
      points.row(field.vertices[i]) +=
          w * field.displacement_m.row(static_cast<Eigen::Index>(i)).cast<double>();
    }
  }
  return points;
}

Eigen::Vector3d landmark(const Points& points, int number) {
  const ModelLandmark& mark = face().landmarks[number];
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    p += mark.barycentric[k] * points.row(face().mesh->triangles(mark.triangle, k)).transpose();
  }
  return p;
}
double distance(const Points& points, int a, int b) {
  return (landmark(points, a) - landmark(points, b)).norm();
}

double area(const Points& points, Eigen::Index t) {
  const auto tri = face().mesh->triangles.row(t);
  const Eigen::Vector3d a = points.row(tri[0]), b = points.row(tri[1]), c = points.row(tri[2]);
  return 0.5 * (b - a).cross(c - a).norm();
}

// Centre and radius of an eyeball, from its vertices.
struct Ball {
  Eigen::Vector3d centre;
  double radius;
};
Ball eyeball(const Points& points, bool left) {
  Eigen::MatrixXd rows(0, 4);
  std::vector<Eigen::Vector4d> equations;
  std::vector<double> right;
  for (Eigen::Index v = 0; v < points.rows(); ++v) {
    if (!is_eye(static_cast<int>(v)) || (points(v, 0) > 0.0) != left) continue;
    const Eigen::Vector3d p = points.row(v);
    equations.emplace_back(2.0 * p.x(), 2.0 * p.y(), 2.0 * p.z(), 1.0);
    right.push_back(p.squaredNorm());
  }
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d sum = Eigen::Vector4d::Zero();
  for (std::size_t i = 0; i < right.size(); ++i) {
    normal += equations[i] * equations[i].transpose();
    sum += equations[i] * right[i];
  }
  const Eigen::Vector4d s = normal.ldlt().solve(sum);
  return {s.head<3>(), std::sqrt(s[3] + s.head<3>().squaredNorm())};
}

// Random values within the parameters' priors (expressions only where `identity` is false).
Values drawn(std::uint64_t stream, bool identity) {
  Random random(7, stream);
  Values values;
  for (std::size_t i = 0; i < face().parameters.size(); ++i) {
    const ParameterBlock& block = face().parameters[i];
    const bool is_identity = static_cast<int>(i) < face().identity_count;
    const double value = block.prior_mean[0] + block.prior_sigma[0] * random.normal();
    if (is_identity == identity) {
      values[block.name] = std::clamp(value, block.lower[0], block.upper[0]);
    }
  }
  return values;
}

std::vector<Values> sampled_expressions() {
  std::vector<Values> all{{}};
  for (std::size_t i = face().identity_count; i < face().parameters.size(); ++i) {
    const ParameterBlock& block = face().parameters[i];
    for (const double share : {0.5, 1.0}) {
      all.push_back({{block.name, share * block.upper[0]}});
      if (block.lower[0] < 0.0) all.push_back({{block.name, share * block.lower[0]}});
    }
  }
  for (std::uint64_t s = 0; s < 20; ++s) all.push_back(drawn(s, false));
  return all;
}

TEST(SweepFace, HasTheParametersItPromises) {
  const MorphShape& shape = face();
  EXPECT_GE(shape.identity_count, 20);
  EXPECT_GE(static_cast<int>(shape.parameters.size()) - shape.identity_count, 25);
  std::set<std::string> names;
  for (const ParameterBlock& block : shape.parameters) {
    EXPECT_TRUE(names.insert(block.name).second) << block.name << " is there twice";
    EXPECT_FALSE(block.doc.empty());
    EXPECT_EQ(block.prior_mean[0], 0.0);
  }
  for (const char* name : {"jaw_open", "jaw_forward", "mouth_funnel", "mouth_pucker", "cheek_puff",
                           "mouth_smile_left", "mouth_smile_right", "mouth_press", "brow_inner_up",
                           "eye_blink_left", "eye_blink_right", "nose_sneer_left"}) {
    EXPECT_TRUE(names.count(name)) << name;
  }
}

TEST(SweepFace, KeepsTheModelContract) { EXPECT_MODEL_CONTRACT(MorphModel(face())); }

TEST(SweepFace, EveryParameterMovesSomething) {
  std::vector<double> moved(face().parameters.size(), 0.0);
  for (const MorphField& field : face().fields) {
    ASSERT_TRUE(std::is_sorted(field.vertices.begin(), field.vertices.end()));
    ASSERT_EQ(field.displacement_m.rows(), static_cast<Eigen::Index>(field.vertices.size()));
    ASSERT_TRUE(field.displacement_m.allFinite());
    moved[field.parameter] =
        std::max<double>(moved[field.parameter], field.displacement_m.rowwise().norm().maxCoeff());
  }
  for (std::size_t i = 0; i < moved.size(); ++i) {
    EXPECT_GT(moved[i], 5e-4) << face().parameters[i].name;
  }
}

TEST(SweepFace, WeightsVanishAtZeroAndHaveTheirDerivative) {
  const double h = 1e-6;
  for (const MorphField& field : face().fields) {
    if (!field.weight) continue;
    EXPECT_EQ(field.weight(0.0).value, 0.0);
    for (const double t : {0.1, 0.4, 0.75, 0.95}) {
      const double difference = (field.weight(t + h).value - field.weight(t - h).value) / (2.0 * h);
      EXPECT_NEAR(field.weight(t).derivative, difference, 1e-7);
    }
  }
}

TEST(SweepFace, NeutralIsASoundMesh) {
  for (const double density : {0.6, 1.0, 1.7}) {
    const MorphShape shape = make_sweep_face({density});
    validate(*shape.mesh, "sweep face");
    EXPECT_EQ(shape.part.size(), static_cast<std::size_t>(shape.mesh->vertex_count()));
    EXPECT_EQ(shape.landmarks.size(), 68u);
  }
  const Points points = face().mesh->positions_m;
  EXPECT_NEAR(static_cast<double>(face().mesh->vertex_count()), 7000.0, 700.0);
  for (Eigen::Index t = 0; t < face().mesh->triangle_count(); ++t) {
    EXPECT_GT(area(points, t), 1e-9) << "triangle " << t;  // 0.001 mm^2
  }
}

TEST(SweepFace, OnlyNeckEarRootsAndGumsAreOpen) {
  // Vertices at the same place (the texture's seam, the vertex of the head, the closed lips) count
  // as one.
  const Points points = face().mesh->positions_m;
  std::map<std::array<long, 3>, int> place;
  std::vector<int> id(points.rows());
  for (Eigen::Index v = 0; v < points.rows(); ++v) {
    std::array<long, 3> key;
    for (int k = 0; k < 3; ++k) key[k] = std::lround(points(v, k) * 1e8);
    id[v] = place.try_emplace(key, static_cast<int>(v)).first->second;
  }
  std::map<std::pair<int, int>, int> edges;
  for (Eigen::Index t = 0; t < face().mesh->triangle_count(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const int a = face().mesh->triangles(t, k), b = face().mesh->triangles(t, (k + 1) % 3);
      ++edges[{id[a], id[b]}];
    }
  }
  const double bottom = points.col(1).minCoeff();
  for (const auto& [edge, count] : edges) {
    if (edges.count({edge.second, edge.first})) continue;
    const Eigen::Vector3d a = points.row(edge.first);
    const FacePart p = part(edge.first);
    EXPECT_TRUE(a.y() < bottom + 1e-6 || p == FacePart::teeth || p == FacePart::ear)
        << "open edge at " << a.transpose();
  }
}

TEST(SweepFace, SkinOfTheFaceFacesOutwards) {
  const Points points = face().mesh->positions_m;
  int inverted = 0;
  for (Eigen::Index t = 0; t < face().mesh->triangle_count(); ++t) {
    const auto tri = face().mesh->triangles.row(t);
    bool skin = true;
    for (int k = 0; k < 3; ++k) {
      skin = skin && (part(tri[k]) == FacePart::skin || part(tri[k]) == FacePart::hair ||
                      part(tri[k]) == FacePart::brow);
    }
    if (!skin) continue;
    const Eigen::Vector3d a = points.row(tri[0]), b = points.row(tri[1]), c = points.row(tri[2]);
    const Eigen::Vector3d middle = (a + b + c) / 3.0;
    Eigen::Vector3d out = middle - Eigen::Vector3d(0, std::clamp(middle.y(), -0.09, 0.04), -0.07);
    if ((b - a).cross(c - a).normalized().dot(out.normalized()) < -0.35) ++inverted;
  }
  EXPECT_EQ(inverted, 0);
}

// Mirror partners are found by place: sort both sides and compare.
void expect_mirrored(const Points& points) {
  std::vector<std::array<double, 3>> left, right;
  for (Eigen::Index v = 0; v < points.rows(); ++v) {
    const double x = points(v, 0);
    if (x > 1e-9) left.push_back({std::round(x * 1e7), points(v, 1), points(v, 2)});
    if (x < -1e-9) right.push_back({std::round(-x * 1e7), points(v, 1), points(v, 2)});
  }
  ASSERT_EQ(left.size(), right.size());
  std::sort(left.begin(), left.end());
  std::sort(right.begin(), right.end());
  for (std::size_t i = 0; i < left.size(); ++i) {
    EXPECT_NEAR(left[i][0], right[i][0], 1.5);
    EXPECT_NEAR(left[i][1], right[i][1], 1e-6);
    EXPECT_NEAR(left[i][2], right[i][2], 1e-6);
  }
}

TEST(SweepFace, VerticesAndTrianglesOfTheSkinAreSymmetric) {
  const Points& points = face().mesh->positions_m;
  expect_mirrored(points);
  std::vector<Eigen::RowVector3d> middles;
  for (Eigen::Index t = 0; t < face().mesh->triangles.rows(); ++t) {
    const auto corner = face().mesh->triangles.row(t);
    bool skin = true;
    for (int v : corner) skin = skin && part(v) == FacePart::skin;
    if (!skin) continue;
    middles.push_back((points.row(corner[0]) + points.row(corner[1]) + points.row(corner[2])) / 3);
  }
  Points rows(static_cast<Eigen::Index>(middles.size()), 3);
  for (std::size_t i = 0; i < middles.size(); ++i) {
    rows.row(static_cast<Eigen::Index>(i)) = middles[i];
  }
  expect_mirrored(rows);
}

TEST(SweepFace, FrameIsBetweenTheEyes) {
  const Points points = face().mesh->positions_m;
  const Ball left = eyeball(points, true), right = eyeball(points, false);
  EXPECT_NEAR((left.centre + right.centre).norm(), 0.0, 1e-6);
  EXPECT_NEAR(left.radius, 0.012, 1e-5);
  EXPECT_GT(landmark(points, 30).z(), 0.035);  // the nose's tip
  EXPECT_LT(landmark(points, 8).y(), -0.1);    // the chin
  EXPECT_GT(landmark(points, 45).x(), 0.0);    // the left eye
  // Iris diameter 11.7 mm: midway between the last ring of the iris and the first of the sclera.
  double iris = 0.0, sclera = 1.0;
  for (Eigen::Index v = 0; v < points.rows(); ++v) {
    if (points(v, 0) < 0.0) continue;
    const double rho = (points.row(v).transpose() - left.centre).head<2>().norm();
    if (part(static_cast<int>(v)) == FacePart::iris) iris = std::max(iris, rho);
    if (part(static_cast<int>(v)) == FacePart::sclera && points(v, 2) > 0.003) {
      sclera = std::min(sclera, rho);
    }
  }
  EXPECT_NEAR(iris + sclera, 0.0117, 3e-4);
}

// Landmark pairs of the published measures: mean and deviation in metres (docs/face-model.md).
struct Published {
  const char* name;
  int a, b;
  double mean_m, deviation_m;
};
constexpr Published published[] = {
    {"mouth_width", 48, 54, 0.0530, 0.0033},      {"eye_fissure_length", 36, 39, 0.0309, 0.0013},
    {"upper_lip_height", 33, 62, 0.0218, 0.0021}, {"nose_protrusion", 30, 33, 0.0197, 0.0019},
    {"face_height", 27, 8, 0.1210, 0.0068},       {"nose_length", 27, 33, 0.0530, 0.0033}};

TEST(SweepFace, MeanFaceHasThePublishedMeasures) {
  const Points points = face().mesh->positions_m;
  EXPECT_NEAR(eyeball(points, true).centre.x() - eyeball(points, false).centre.x(), 0.0633, 1e-4);
  for (const Published& p : published) {
    EXPECT_NEAR(distance(points, p.a, p.b), p.mean_m, 0.02 * p.mean_m) << p.name;
  }
  EXPECT_NEAR(distance(points, 39, 42), 0.0325, 0.0025);  // en-en
  EXPECT_NEAR(distance(points, 36, 45), 0.0905, 0.0035);  // ex-ex
}

TEST(SweepFace, OneDeviationMovesTheMeasureByOneDeviation) {
  for (const Published& p : published) {
    const double up = distance(posed({{p.name, 1.0}}), p.a, p.b);
    const double down = distance(posed({{p.name, -1.0}}), p.a, p.b);
    EXPECT_NEAR(0.5 * (up - down), p.deviation_m, 0.1 * p.deviation_m) << p.name;
  }
  const auto red = [](const char* name, double sd, int top, int low) {
    const Points points = posed({{name, sd}});
    return landmark(points, top).y() - landmark(points, low).y();
  };
  EXPECT_NEAR(red("upper_vermilion_height", 1, 51, 62) - red("upper_vermilion_height", 0, 51, 62),
              0.0014, 0.00014);
  EXPECT_NEAR(red("lower_vermilion_height", 1, 66, 57) - red("lower_vermilion_height", 0, 66, 57),
              0.0016, 0.00016);
  const auto size = [](const char* name, double sd, FacePart of, int axis) {
    const Points points = posed({{name, sd}});
    double low = 1.0, high = -1.0;
    for (int v = 0; v < points.rows(); ++v) {
      if (part(v) != of) continue;
      low = std::min(low, points(v, axis));
      high = std::max(high, points(v, axis));
    }
    return high - low;
  };
  EXPECT_NEAR(
      size("head_breadth", 1, FacePart::hair, 0) - size("head_breadth", 0, FacePart::hair, 0),
      0.006, 0.0006);
  EXPECT_NEAR(size("ear_length", 1, FacePart::ear, 1) - size("ear_length", 0, FacePart::ear, 1),
              0.0037, 0.00037);
  const Points up = posed({{"interpupillary_distance", 1.0}});
  EXPECT_NEAR(eyeball(up, true).centre.x() - eyeball(up, false).centre.x(), 0.0633 + 0.0036, 1e-4);
}

// All thirds forwards alike are a longer head: every place moves by its distance from the ears.
TEST(SweepFace, FacialDepthsLengthenTheFaceTogetherAndOneByOneTheirThird) {
  const Points mean = face().mesh->positions_m;
  const Values together{{"upper_face_depth", 4.0 / 4.5},
                        {"middle_face_depth", 4.0 / 5.0},
                        {"lower_face_depth", 4.0 / 6.0}};
  const Points longer = posed(together);
  for (const int mark : {2, 5, 8, 21, 27, 30, 33, 48, 51, 57}) {
    const Eigen::Vector3d at = landmark(mean, mark), moved = landmark(longer, mark) - at;
    // Places are those before the mean measures were met, up to 2 mm from here.
    EXPECT_NEAR(moved.z(), 0.004 * (at.z() + 0.075) / 0.095, 1e-4) << mark;
    EXPECT_NEAR(moved.head<2>().norm(), 0.0, 1e-6) << mark;
  }
  EXPECT_NEAR(eyeball(longer, true).radius, eyeball(mean, true).radius, 1e-6);
  EXPECT_NEAR(eyeball(longer, true).centre.z() - eyeball(mean, true).centre.z(),
              0.004 * 0.075 / 0.095, 2e-5);
  const std::array<int, 3> middle_of = {27, 33, 8};
  const std::array<const char*, 3> third = {"upper_face_depth", "middle_face_depth",
                                            "lower_face_depth"};
  for (int own = 0; own < 3; ++own) {
    const Points points = posed({{third[own], 1.0}});
    for (int other = 0; other < 3; ++other) {
      const double z =
          landmark(points, middle_of[other]).z() - landmark(mean, middle_of[other]).z();
      if (own == other) {
        EXPECT_GT(z, 0.003) << third[own];
      } else {
        EXPECT_LT(z, 0.0012) << third[own] << " at " << middle_of[other];
      }
    }
  }
}

TEST(SweepFace, LipsCloseWithoutAGap) {
  // Upper and lower edge of the inner lip's landmarks coincide, for other people too.
  for (std::uint64_t s = 0; s < 5; ++s) {
    const Points points = posed(s == 0 ? Values{} : drawn(s, true));
    for (const auto& [top, low] : {std::pair{61, 67}, {62, 66}, {63, 65}}) {
      EXPECT_LT(distance(points, top, low), 2e-5);
    }
  }
}

TEST(SweepFace, JawOpensTheMouthAndShowsTeeth) {
  const Points points = posed({{"jaw_open", 1.0}});
  EXPECT_GT(distance(points, 62, 66), 0.020);
  EXPECT_LT(distance(points, 62, 66), 0.055);
  // The gap shows teeth: a tooth's vertex lies between the lips in the picture from the front.
  const double top = landmark(points, 62).y(), low = landmark(points, 66).y();
  int shown = 0;
  for (Eigen::Index v = 0; v < points.rows(); ++v) {
    if (part(static_cast<int>(v)) == FacePart::teeth && std::abs(points(v, 0)) < 0.01 &&
        points(v, 1) < top && points(v, 1) > low) {
      ++shown;
    }
  }
  EXPECT_GT(shown, 5);
}

TEST(SweepFace, JawTurnsRigidly) {
  const Points rest = face().mesh->positions_m, open = posed({{"jaw_open", 0.8}});
  std::vector<int> lower;
  for (Eigen::Index v = 0; v < rest.rows(); ++v) {
    if (part(static_cast<int>(v)) == FacePart::teeth && (open.row(v) - rest.row(v)).norm() > 1e-4) {
      lower.push_back(static_cast<int>(v));
    }
  }
  ASSERT_GT(lower.size(), 40u);
  for (std::size_t i = 0; i + 7 < lower.size(); i += 7) {
    EXPECT_NEAR((rest.row(lower[i]) - rest.row(lower[i + 7])).norm(),
                (open.row(lower[i]) - open.row(lower[i + 7])).norm(), 1e-6);
  }
}

TEST(SweepFace, BlinkClosesTheEye) {
  const Points points = posed({{"eye_blink_left", 1.0}, {"eye_blink_right", 1.0}});
  for (const auto& [top, low] : {std::pair{37, 41}, {38, 40}, {43, 47}, {44, 46}}) {
    EXPECT_LT(distance(points, top, low), 5e-4);
  }
  const Points one = posed({{"eye_blink_left", 1.0}});
  EXPECT_LT(distance(one, 43, 47), 5e-4);
  EXPECT_GT(distance(one, 37, 41), 5e-3);
}

TEST(SweepFace, LidsStayOutsideTheEyeballs) {
  for (const Values& values : sampled_expressions()) {
    const Points points = posed(values);
    const Ball ball = eyeball(points, true);
    double nearest = 1.0;
    for (Eigen::Index t = 0; t < face().mesh->triangle_count(); ++t) {
      const auto tri = face().mesh->triangles.row(t);
      Eigen::Vector3d middle = Eigen::Vector3d::Zero();
      bool skin = true;
      for (int k = 0; k < 3; ++k) {
        const FacePart p = part(tri[k]);
        skin = skin && (p == FacePart::skin || p == FacePart::lashes);
        middle += points.row(tri[k]).transpose() / 3.0;
      }
      if (skin && middle.z() > 0.0) nearest = std::min(nearest, (middle - ball.centre).norm());
    }
    EXPECT_GT(nearest, ball.radius + 1e-4)
        << (values.size() == 1 ? values.begin()->first : "several");
  }
}

TEST(SweepFace, TeethStayBehindTheLips) {
  const auto& triangles = face().mesh->triangles;
  std::vector<int> teeth;
  for (int v = 0; v < face().mesh->vertex_count(); ++v) {
    if (part(v) == FacePart::teeth) teeth.push_back(v);
  }
  for (const Values& values : sampled_expressions()) {
    const Points points = posed(values);
    double deepest = 0.0;
    for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
      const auto tri = triangles.row(t);
      const FacePart p = part(tri[0]);
      if (p != part(tri[1]) || p != part(tri[2]) || points(tri[0], 2) < -0.04) continue;
      if (p != FacePart::skin && p != FacePart::lips) continue;
      const Eigen::Vector3d a = points.row(tri[0]), b = points.row(tri[1]), c = points.row(tri[2]);
      const Eigen::Vector3d n = (b - a).cross(c - a);
      if (n.z() <= 0.3 * n.norm()) continue;
      for (const int v : teeth) {
        const Eigen::Vector3d q = points.row(v);
        if (std::abs(q.x() - a.x()) > 0.01 || std::abs(q.y() - a.y()) > 0.01) continue;
        // Barycentric place of q in the triangle seen from the front.
        const double w1 = ((q - a).x() * (c - a).y() - (c - a).x() * (q - a).y()) / n.z();
        const double w2 = ((b - a).x() * (q - a).y() - (q - a).x() * (b - a).y()) / n.z();
        if (w1 < 0.0 || w2 < 0.0 || w1 + w2 > 1.0) continue;
        const double skin_z = a.z() + w1 * (b - a).z() + w2 * (c - a).z();
        deepest = std::max(deepest, q.z() - skin_z);
      }
    }
    EXPECT_LT(deepest, 1e-4) << (values.size() == 1 ? values.begin()->first : "several");
  }
}

TEST(SweepFace, TextureChartsDoNotOverlap) {
  const Mesh& mesh = *face().mesh;
  ASSERT_EQ(mesh.uvs.rows(), mesh.positions_m.rows());
  EXPECT_GE(mesh.uvs.minCoeff(), 0.0f);
  EXPECT_LE(mesh.uvs.maxCoeff(), 1.0f);
  // Every texel centre of a fine grid lies strictly inside at most one triangle.
  constexpr int size = 1500;
  std::vector<int> owner(static_cast<std::size_t>(size) * size, -1);
  int overlaps = 0;
  for (Eigen::Index t = 0; t < mesh.triangle_count(); ++t) {
    std::array<Eigen::Vector2d, 3> p;
    for (int k = 0; k < 3; ++k) p[k] = size * mesh.uvs.row(mesh.triangles(t, k)).cast<double>();
    const auto cross = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
      return a.x() * b.y() - a.y() * b.x();
    };
    const double twice = cross(p[1] - p[0], p[2] - p[0]);
    if (std::abs(twice) < 1e-9) continue;
    const auto [x0, x1] = std::minmax({p[0].x(), p[1].x(), p[2].x()});
    const auto [y0, y1] = std::minmax({p[0].y(), p[1].y(), p[2].y()});
    for (int y = static_cast<int>(y0); y <= std::min<int>(size - 1, static_cast<int>(y1)); ++y) {
      for (int x = static_cast<int>(x0); x <= std::min<int>(size - 1, static_cast<int>(x1)); ++x) {
        const Eigen::Vector2d q(x + 0.5, y + 0.5);
        bool inside = true;
        for (int k = 0; k < 3; ++k) {
          inside = inside && cross(p[(k + 1) % 3] - p[k], q - p[k]) / twice > 1e-6;
        }
        if (!inside) continue;
        int& texel = owner[static_cast<std::size_t>(y) * size + x];
        if (texel >= 0) ++overlaps;
        texel = static_cast<int>(t);
      }
    }
  }
  EXPECT_EQ(overlaps, 0);
}

TEST(SweepFace, LandmarksLieOnTheirFeatures) {
  const Points points = face().mesh->positions_m;
  std::set<std::string> names;
  for (const ModelLandmark& mark : face().landmarks) {
    EXPECT_TRUE(names.insert(mark.name).second);
    EXPECT_NEAR(mark.barycentric[0] + mark.barycentric[1] + mark.barycentric[2], 1.0f, 1e-5f);
  }
  for (int i = 0; i < 8; ++i) {  // jaw line: outwards and upwards from the chin
    EXPECT_LT(landmark(points, i).x(), landmark(points, i + 1).x());
    EXPECT_GT(landmark(points, i).y(), landmark(points, i + 1).y());
  }
  for (int i = 0; i <= 16; ++i) {
    EXPECT_NEAR(landmark(points, i).x(), -landmark(points, 16 - i).x(), 1e-6);
  }
  for (int i = 17; i < 26; ++i) EXPECT_LT(landmark(points, i).x(), landmark(points, i + 1).x());
  for (int i = 27; i < 30; ++i) {
    EXPECT_NEAR(landmark(points, i).x(), 0.0, 1e-6);
    EXPECT_GT(landmark(points, i).y(), landmark(points, i + 1).y());
  }
  for (int i = 48; i < 68; ++i) {
    EXPECT_LT(landmark(points, i).y(), landmark(points, 33).y());
    EXPECT_GT(landmark(points, i).y(), landmark(points, 8).y());
  }
}

TEST(SweepFace, RejectsImpossibleDensities) {
  EXPECT_THROW(make_sweep_face({0.0}), InvalidInput);
  EXPECT_THROW(make_sweep_face({std::nan("")}), InvalidInput);
}

}  // namespace
}  // namespace semblance
