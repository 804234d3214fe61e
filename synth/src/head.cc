#include "head.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <tuple>

#include "noise.h"
#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"
#include "solids.h"

namespace semblance {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

constexpr float kTexelM = 0.00032f;                 // wanted size of a texel of the skin
constexpr float kEyeHalfWidthM = 0.017f;            // half the width of an eye's texture
constexpr float kIrisRadiusM = 0.0060f;             // half the horizontal visible iris diameter
const Eigen::Vector3d kNeckTop(0.0, -0.08, -0.09);  // model frame, where the head turns

enum class Kind { skin, left_eye, right_eye, teeth, mouth, tongue, lashes, inner };

Kind kind_of(FacePart part, float x) {
  switch (part) {
    case FacePart::sclera:
    case FacePart::iris:
    case FacePart::pupil:
      return x > 0 ? Kind::left_eye : Kind::right_eye;
    case FacePart::teeth:
      return Kind::teeth;
    case FacePart::mouth_cavity:
      return Kind::mouth;
    case FacePart::tongue:
      return Kind::tongue;
    case FacePart::lashes:
      return Kind::lashes;
    case FacePart::other:
      return Kind::inner;
    default:
      return Kind::skin;
  }
}

// Calls visit(texel x, texel y, b0, b1, b2) for every texel centre inside the triangle.
template <class Visit>
void for_each_texel(const std::array<Vector2f, 3>& p, int width, int height, const Visit& visit) {
  const float area = (p[1] - p[0]).x() * (p[2] - p[0]).y() - (p[1] - p[0]).y() * (p[2] - p[0]).x();
  if (std::abs(area) < 1e-9f) return;
  const auto lowest = [&](int k) { return std::min({p[0][k], p[1][k], p[2][k]}); };
  const auto highest = [&](int k) { return std::max({p[0][k], p[1][k], p[2][k]}); };
  // One texel around each triangle is filled too, so that bilinear look-ups at seams stay inside.
  const int x0 = std::max(0, static_cast<int>(lowest(0)) - 2);
  const int x1 = std::min(width - 1, static_cast<int>(highest(0)) + 2);
  const int y0 = std::max(0, static_cast<int>(lowest(1)) - 2);
  const int y1 = std::min(height - 1, static_cast<int>(highest(1)) + 2);
  for (int y = y0; y <= y1; ++y)
    for (int x = x0; x <= x1; ++x) {
      const Vector2f q(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
      const auto edge = [&](const Vector2f& a, const Vector2f& b) {
        return ((b - a).x() * (q - a).y() - (b - a).y() * (q - a).x()) / area;
      };
      visit(x, y, edge(p[1], p[2]), edge(p[2], p[0]), edge(p[0], p[1]));
    }
}

}  // namespace

SynthHead::SynthHead(std::shared_ptr<const MorphModel> model, const PersonLook& look,
                     const MarkerSpec& markers, double texel_m, const std::string& source)
    : model_(std::move(model)) {
  const MorphShape& shape = model_->shape();
  if (shape.landmarks.size() != 68)
    throw InvalidInput(source + ": synthesis needs a face model with the 68 landmarks");
  if (static_cast<Eigen::Index>(shape.part.size()) != shape.mesh->vertex_count())
    throw InvalidInput(source + ": synthesis needs a face model whose vertices have parts");
  if (shape.mesh->uvs.rows() != shape.mesh->vertex_count())
    throw InvalidInput(source + ": synthesis needs a face model with texture coordinates");
  const auto& positions = shape.mesh->positions_m;
  for (int i = 0; i < 68; ++i) {
    const ModelLandmark& mark = shape.landmarks[i];
    Vector3f place = Vector3f::Zero();
    for (int c = 0; c < 3; ++c)
      place += mark.barycentric[c] *
               positions.row(shape.mesh->triangles(mark.triangle, c)).transpose().cast<float>();
    neutral_landmarks_[i] = place;
  }
  const FaceColour colour(look, neutral_landmarks_,
                          static_cast<float>(positions.col(1).maxCoeff()));
  weld();
  split(look);
  grow_hair(colour, look);
  paint_ = LipPaint(markers, neutral_landmarks_, *pieces_.front().mesh);
  bake_skin(colour, texel_m);
  for (Piece& piece : pieces_)
    if (piece.name == "left_eye" || piece.name == "right_eye") bake_eye(piece, colour);
  build_torso(look);
  measure_ambient();
}

// Vertices doubled along texture seams get one common normal.
void SynthHead::weld() {
  const auto& positions = model_->shape().mesh->positions_m;
  std::map<std::tuple<double, double, double>, int> first;
  welded_.resize(positions.rows());
  for (Eigen::Index i = 0; i < positions.rows(); ++i)
    welded_[i] =
        first.try_emplace({positions(i, 0), positions(i, 1), positions(i, 2)}, static_cast<int>(i))
            .first->second;
}

SynthHead::Piece SynthHead::cut(const std::string& name, const std::vector<int>& triangles) const {
  const Mesh& whole = *model_->shape().mesh;
  Piece piece{name, std::make_shared<Mesh>(), {}, {}};
  std::vector<int> index(whole.vertex_count(), -1);
  piece.mesh->triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (int c = 0; c < 3; ++c) {
      const int vertex = whole.triangles(triangles[t], c);
      if (index[vertex] < 0) {
        index[vertex] = static_cast<int>(piece.model_vertex.size());
        piece.model_vertex.push_back(vertex);
      }
      piece.mesh->triangles(static_cast<Eigen::Index>(t), c) = index[vertex];
    }
  const auto count = static_cast<Eigen::Index>(piece.model_vertex.size());
  piece.mesh->positions_m.resize(count, 3);
  piece.mesh->uvs.resize(count, 2);
  for (Eigen::Index i = 0; i < count; ++i) {
    piece.mesh->positions_m.row(i) = whole.positions_m.row(piece.model_vertex[i]);
    piece.mesh->uvs.row(i) = whole.uvs.row(piece.model_vertex[i]);
  }
  return piece;
}

void SynthHead::split(const PersonLook& look) {
  const MorphShape& shape = model_->shape();
  std::map<Kind, std::vector<int>> triangles;
  for (Eigen::Index t = 0; t < shape.mesh->triangle_count(); ++t) {
    // A triangle between two parts is skin if any corner is.
    Kind kind = Kind::inner;
    for (int c = 0; c < 3; ++c) {
      const int vertex = shape.mesh->triangles(t, c);
      const Kind corner = kind_of(static_cast<FacePart>(shape.part[vertex]),
                                  static_cast<float>(shape.mesh->positions_m(vertex, 0)));
      if (c == 0 || corner == Kind::skin) kind = corner;
    }
    triangles[kind].push_back(static_cast<int>(t));
  }
  struct Style {
    Kind kind;
    const char* name;
    Vector3f colour;
    Surface surface;
  };
  const std::vector<Style> styles = {
      {Kind::skin, "skin", Vector3f::Ones(), {0.045f, 14.0f, 0.18f, {}}},
      {Kind::left_eye, "left_eye", Vector3f::Ones(), {0.9f, 220.0f, 0.1f, {}}},
      {Kind::right_eye, "right_eye", Vector3f::Ones(), {0.9f, 220.0f, 0.1f, {}}},
      {Kind::teeth, "teeth", Vector3f(0.62f, 0.55f, 0.44f), {0.25f, 60.0f, 0.1f, {}}},
      {Kind::mouth, "mouth", Vector3f(0.22f, 0.07f, 0.065f), {0.05f, 30.0f, 0.0f, {}}},
      {Kind::tongue, "tongue", Vector3f(0.36f, 0.14f, 0.13f), {0.1f, 30.0f, 0.1f, {}}},
      {Kind::lashes, "lashes", (0.3f * look.hair).eval(), {0.0f, 10.0f, 0.0f, {}}},
      // What a model leaves unnamed is the inside of lids and sockets.
      {Kind::inner, "inner", (0.6f * skin_albedo(look.skin_tone)).eval(), {0.1f, 30.0f, 0.1f, {}}}};
  for (const Style& style : styles) {
    if (triangles[style.kind].empty()) continue;
    pieces_.push_back(cut(style.name, triangles[style.kind]));
    pieces_.back().material.colour = style.colour;
    surfaces_.push_back(style.surface);
  }
  welded_triangles_.resize(shape.mesh->triangle_count(), 3);
  for (Eigen::Index t = 0; t < shape.mesh->triangle_count(); ++t)
    for (int c = 0; c < 3; ++c) welded_triangles_(t, c) = welded_[shape.mesh->triangles(t, c)];
}

void SynthHead::grow_hair(const FaceColour& colour, const PersonLook& look) {
  const MorphShape& shape = model_->shape();
  const auto& positions = shape.mesh->positions_m;
  const float chin_y = neutral_landmarks_[8].y();
  hair_m_.assign(positions.rows(), 0.0f);
  neck_share_.assign(positions.rows(), 0.0f);
  for (Eigen::Index i = 0; i < positions.rows(); ++i) {
    const Vector3f place = positions.row(i).transpose().cast<float>();
    const auto part = static_cast<FacePart>(shape.part[i]);
    if (kind_of(part, place.x()) != Kind::skin) continue;
    // The neck twists from a thumb's breadth below the jaw (higher at the nape) to the collar.
    const float back = smooth_step(0.0f, -0.12f, place.z());
    const float top = chin_y - 0.022f + 0.03f * back;
    neck_share_[i] = smooth_step(top, top - 0.085f, place.y());
    if (part == FacePart::ear) continue;
    const float tufts = fractal_noise(place / 0.025f, 3, look.noise_seed + 79);
    hair_m_[i] = colour.hair_cover(place - Vector3f(0, 0.004f, 0)) * look.hair_height_m *
                 std::max(0.2f, 0.9f + 0.5f * tufts);
  }
}

void SynthHead::bake_skin(const FaceColour& colour, double texel_m) {
  Piece& skin = pieces_.front();
  Mesh& mesh = *skin.mesh;
  // Unit squares of texture coordinates (UDIM tiles) are laid side by side.
  std::map<std::pair<int, int>, int> tiles;
  std::vector<std::pair<int, int>> vertex_tile(mesh.vertex_count());
  double area_m2 = 0, area_uv = 0;
  for (Eigen::Index t = 0; t < mesh.triangle_count(); ++t) {
    const Eigen::Vector3i c = mesh.triangles.row(t);
    const Vector2f middle = (mesh.uvs.row(c[0]) + mesh.uvs.row(c[1]) + mesh.uvs.row(c[2])) / 3;
    const std::pair<int, int> tile(static_cast<int>(std::floor(middle.x())),
                                   static_cast<int>(std::floor(middle.y())));
    tiles.try_emplace(tile, static_cast<int>(tiles.size()));
    for (int k = 0; k < 3; ++k) vertex_tile[c[k]] = tile;
    const Eigen::Vector3d a = mesh.positions_m.row(c[1]) - mesh.positions_m.row(c[0]);
    const Eigen::Vector3d b = mesh.positions_m.row(c[2]) - mesh.positions_m.row(c[0]);
    const Vector2f u = mesh.uvs.row(c[1]) - mesh.uvs.row(c[0]);
    const Vector2f v = mesh.uvs.row(c[2]) - mesh.uvs.row(c[0]);
    area_m2 += 0.5 * a.cross(b).norm();
    area_uv += 0.5 * std::abs(u.x() * v.y() - u.y() * v.x());
  }
  if (!(area_uv > 0)) throw InvalidInput("face model: its texture coordinates enclose no area");
  const int size =
      static_cast<int>(std::clamp(std::sqrt(area_m2 / area_uv) / texel_m, 256.0, 2048.0));
  const int count = static_cast<int>(tiles.size());
  const int width = size * count;
  for (Eigen::Index i = 0; i < mesh.vertex_count(); ++i) {
    const auto& tile = vertex_tile[i];
    mesh.uvs(i, 0) =
        (mesh.uvs(i, 0) - static_cast<float>(tile.first) + static_cast<float>(tiles.at(tile))) /
        static_cast<float>(count);
    mesh.uvs(i, 1) -= static_cast<float>(tile.second);
  }
  auto texture = std::make_shared<Image>(width, size, 3);  // places first, then their colours
  // 0: empty, 1: on the rim of a triangle, 2: inside one.
  std::vector<std::uint8_t> state(static_cast<std::size_t>(width) * size, 0);
  for (Eigen::Index t = 0; t < mesh.triangle_count(); ++t) {
    const Eigen::Vector3i c = mesh.triangles.row(t);
    std::array<Vector2f, 3> corner;
    std::array<Vector3f, 3> place;
    for (int k = 0; k < 3; ++k) {
      corner[k] = Vector2f(mesh.uvs(c[k], 0) * static_cast<float>(width),
                           (1 - mesh.uvs(c[k], 1)) * static_cast<float>(size));
      place[k] = mesh.positions_m.row(c[k]).transpose().cast<float>();
    }
    for_each_texel(corner, width, size, [&](int x, int y, float b0, float b1, float b2) {
      const bool in = std::min({b0, b1, b2}) >= 0;
      std::uint8_t& now = state[static_cast<std::size_t>(y) * width + x];
      if (now == 2 || (!in && now == 1)) return;
      if (!in) {  // rim: the nearest point of the triangle, roughly
        b0 = std::max(b0, 0.0f), b1 = std::max(b1, 0.0f), b2 = std::max(b2, 0.0f);
        const float sum = b0 + b1 + b2;
        b0 /= sum, b1 /= sum, b2 /= sum;
      }
      now = in ? 2 : 1;
      const Vector3f spot = b0 * place[0] + b1 * place[1] + b2 * place[2];
      std::copy_n(spot.data(), 3, texture->pixel(x, y));
    });
  }
  parallel_for(static_cast<std::size_t>(size), [&](std::size_t y) {
    for (int x = 0; x < width; ++x) {
      if (state[y * width + x] == 0) continue;
      float* pixel = texture->pixel(x, static_cast<int>(y));
      const Eigen::Map<const Vector3f> place(pixel);
      const Vector3f albedo = paint_.over(place, colour.skin(place));
      std::copy_n(albedo.data(), 3, pixel);
    }
  });
  skin.material.texture = texture;
}

void SynthHead::bake_eye(Piece& piece, const FaceColour& colour) {
  constexpr int kSize = 320;
  Mesh& mesh = *piece.mesh;
  const Eigen::Vector3d centre =
      0.5 * (mesh.positions_m.colwise().minCoeff() + mesh.positions_m.colwise().maxCoeff());
  for (Eigen::Index i = 0; i < mesh.vertex_count(); ++i)
    for (int k = 0; k < 2; ++k)
      mesh.uvs(i, k) =
          0.5f + static_cast<float>(mesh.positions_m(i, k) - centre[k]) / (2 * kEyeHalfWidthM);
  auto texture = std::make_shared<Image>(kSize, kSize, 3);
  for (int y = 0; y < kSize; ++y)
    for (int x = 0; x < kSize; ++x) {
      const Vector2f offset((static_cast<float>(x) + 0.5f) / kSize - 0.5f,
                            0.5f - (static_cast<float>(y) + 0.5f) / kSize);
      const Vector3f albedo = colour.eye(2 * kEyeHalfWidthM * offset, kIrisRadiusM);
      std::copy_n(albedo.data(), 3, texture->pixel(x, y));
    }
  piece.material.texture = texture;
}

void SynthHead::build_torso(const PersonLook& look) {
  // Rings from the collar down: height, half width, half depth, shift to the back (metres, from the
  // top of the neck).
  const std::vector<Ring> rings = {
      {-0.086f, 0.064f, 0.066f, 0.004f}, {-0.078f, 0.070f, 0.072f, 0.004f},
      {-0.088f, 0.080f, 0.082f, 0.002f}, {-0.105f, 0.105f, 0.092f, 0.004f},
      {-0.120f, 0.140f, 0.100f, 0.008f}, {-0.140f, 0.180f, 0.106f, 0.010f},
      {-0.170f, 0.210f, 0.110f, 0.010f}, {-0.220f, 0.225f, 0.114f, 0.006f},
      {-0.320f, 0.225f, 0.122f, 0.000f}, {-0.600f, 0.215f, 0.125f, 0.000f}};
  torso_.name = "torso";
  torso_.mesh = std::make_shared<Mesh>(loft(rings, 48, 2.3f));
  torso_.material.colour = look.cloth;
  surfaces_.push_back({0.01f, 8.0f, 0.05f, {}});
}

void SynthHead::smooth_normals(const PointsF& positions_m, PointsF& normals) const {
  vertex_normals(positions_m, welded_triangles_, normals);
  for (std::size_t i = 0; i < welded_.size(); ++i)
    normals.row(static_cast<Eigen::Index>(i)) = normals.row(welded_[i]).eval();
}

void SynthHead::shape_head(const Eigen::VectorXd& x, PointsF& positions_m, PointsF& normals) const {
  Scene bare;
  model_->synthesize(x, bare);
  positions_m = std::move(bare.objects.front().positions_m);
  smooth_normals(positions_m, normals);
  for (std::size_t i = 0; i < hair_m_.size(); ++i)
    if (hair_m_[i] > 0) {
      const auto row = static_cast<Eigen::Index>(i);
      positions_m.row(row) += hair_m_[i] * normals.row(row);
    }
}

namespace {

// The torso goes where the neck goes, and turns a quarter as far as the head.
Rigid3 torso_pose(const Rigid3& world_from_model) {
  const Eigen::Vector3d nose = world_from_model.rotation * Eigen::Vector3d::UnitZ();
  const double yaw = 0.25 * std::atan2(nose.x(), nose.z());
  return {Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY())),
          world_from_model * kNeckTop};
}

// Models end in shoulders of their own: below the collar they are drawn in under the cloth.
void tuck(const Rigid3& torso, PointsF& positions_m, Eigen::Index row) {
  const Eigen::Matrix3f turn = torso.rotation.toRotationMatrix().cast<float>();
  const Vector3f origin = torso.translation_m.cast<float>();
  Vector3f local = turn.transpose() * (positions_m.row(row).transpose() - origin);
  const float limit = 0.060f + 0.03f * smooth_step(-0.075f, -0.02f, local.y());
  const float below = smooth_step(-0.02f, -0.05f, local.y());
  const float radius = std::hypot(local.x(), local.z());
  if (below <= 0 || radius <= limit) return;
  const float factor = 1 + below * (limit / radius - 1);
  local.x() *= factor, local.z() *= factor;
  positions_m.row(row) = turn * local + origin;
}

Rigid3 pose_of(const Eigen::VectorXd& x) {
  return {Eigen::Quaterniond(x[0], x[1], x[2], x[3]).normalized(), x.segment<3>(4)};
}

}  // namespace

void SynthHead::pose(const Eigen::VectorXd& x, Scene& scene) const {
  PointsF positions, normals;
  shape_head(x, positions, normals);
  const Rigid3 world_from_model = pose_of(x), torso = torso_pose(world_from_model);
  const Rigid3 settled =  // of the model, were the head to turn with the torso
      Rigid3{torso.rotation, torso.translation_m - torso.rotation * kNeckTop} *
      world_from_model.inverse();
  const Eigen::Matrix3f turn = settled.rotation.toRotationMatrix().cast<float>();
  const Vector3f shift = settled.translation_m.cast<float>();
  for (std::size_t i = 0; i < neck_share_.size(); ++i) {
    if (neck_share_[i] <= 0) continue;
    const auto row = static_cast<Eigen::Index>(i);
    const Vector3f now = positions.row(row);
    positions.row(row) = now + neck_share_[i] * (turn * now + shift - now);
    tuck(torso, positions, row);
  }
  smooth_normals(positions, normals);
  scene.objects.resize(pieces_.size() + 1);
  for (std::size_t p = 0; p < pieces_.size(); ++p) {
    const Piece& piece = pieces_[p];
    SceneObject& object = scene.objects[p];
    object.name = piece.name;
    object.mesh = piece.mesh;
    object.material = piece.material;
    object.positions_m = positions(piece.model_vertex, Eigen::all);
    object.normals = normals(piece.model_vertex, Eigen::all);
  }
  SceneObject& body = scene.objects.back();
  body.name = torso_.name;
  body.mesh = torso_.mesh;
  body.material = torso_.material;
  body.positions_m =
      ((torso.rotation.toRotationMatrix() * torso_.mesh->positions_m.transpose()).colwise() +
       torso.translation_m)
          .transpose()
          .cast<float>();
  vertex_normals(body.positions_m, body.mesh->triangles, body.normals);
}

std::vector<Eigen::Vector3d> SynthHead::landmarks(const Eigen::VectorXd& x) const {
  Scene bare;
  model_->synthesize(x, bare);
  const SceneObject& object = bare.objects.front();
  std::vector<Eigen::Vector3d> out;
  for (const ModelLandmark& mark : model_->landmarks()) {
    Vector3f place = Vector3f::Zero();
    for (int c = 0; c < 3; ++c)
      place += mark.barycentric[c] *
               object.positions_m.row(object.mesh->triangles(mark.triangle, c)).transpose();
    out.push_back(place.cast<double>());
  }
  return out;
}

std::vector<Eigen::Vector3d> SynthHead::lip_markers(const Eigen::VectorXd& x) const {
  Scene bare;
  model_->synthesize(x, bare);
  const PointsF& positions = bare.objects.front().positions_m;
  std::vector<Eigen::Vector3d> out;
  for (const LipPaint::Dot& dot : paint_.dots()) {
    Vector3f place = Vector3f::Zero();
    for (int c = 0; c < 3; ++c)
      place +=
          dot.weights[c] * positions.row(pieces_.front().model_vertex[dot.corners[c]]).transpose();
    out.push_back(place.cast<double>());
  }
  return out;
}

// How open every place is to the sky: eye sockets, nostrils, under the chin. The mouth is ajar, or
// teeth would be black when it opens.
void SynthHead::measure_ambient() {
  constexpr int kRays = 48;
  constexpr float kReachM = 0.12f;
  Scene scene;
  Eigen::VectorXd x = model_->parameters().initial();
  const auto& blocks = model_->parameters().blocks();
  for (std::size_t i = 0; i < blocks.size(); ++i)
    if (blocks[i].name == "jaw_open") x[model_->parameters().offset(static_cast<int>(i))] = 0.4;
  pose(x, scene);
  Tracer tracer;
  tracer.set_scene(scene, surfaces_);
  for (std::size_t i = 0; i < scene.objects.size(); ++i)
    surfaces_[i].ambient = tracer.ambient_occlusion(static_cast<int>(i), kRays, kReachM);
}

SceneObject make_hand(const Rigid3& world_from_model, const Eigen::Vector3d& mouth_world_m,
                      double raised, double drawn_back_m, const Eigen::Vector3f& colour) {
  static const std::shared_ptr<const Mesh> mesh = std::make_shared<const Mesh>(hand_mesh());
  const Eigen::Vector3d nose = world_from_model.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d down = -Eigen::Vector3d::UnitY();
  const Eigen::Vector3d place =
      mouth_world_m + 0.037 * nose + (1 - raised) * (0.32 * down + 0.06 * Eigen::Vector3d::UnitX());
  SceneObject hand;
  hand.name = "hand";
  hand.mesh = mesh;
  hand.material.colour = colour;
  const Eigen::Matrix3d turn =
      (Eigen::AngleAxisd(0.5 * std::atan2(nose.x(), nose.z()), Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(0.9 - 0.5 * raised, Eigen::Vector3d::UnitZ()))
          .toRotationMatrix();
  const Eigen::Vector3d back = -drawn_back_m * turn.col(0);
  hand.positions_m =
      ((turn * mesh->positions_m.transpose()).colwise() + (place + back)).transpose().cast<float>();
  vertex_normals(hand.positions_m, mesh->triangles, hand.normals);
  return hand;
}

}  // namespace semblance
