#include "object_objective.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "colour_comparison.h"
#include "outline_comparison.h"
#include "semblance/core/parallel.h"

namespace semblance {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kPairWidth = 4.0;  // deviations; Geman-McClure
constexpr double kFarthest_m = 1e4;

Matrix3d cross_matrix(const Vector3d& v) {
  Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

ParameterBlock block(const std::string& name, const std::string& unit, const VectorXd& lower,
                     const VectorXd& upper, double step) {
  ParameterBlock out;
  out.name = name;
  out.unit = unit;
  out.size = static_cast<int>(lower.size());
  out.lower = lower;
  out.upper = upper;
  out.prior_mean = 0.5 * (lower + upper);
  out.prior_sigma = VectorXd::Constant(lower.size(), step);
  return out;
}

/// Blocks whose prior deviations are the steps to expect, which is where optimizers take theirs
/// from.
ParameterSpace make_space(const Camera& camera, const IntrinsicsFreedom& freedom,
                          const std::vector<Rigid3>& start) {
  std::vector<ParameterBlock> blocks;
  const double width = camera.width;
  if (freedom.focal) {
    blocks.push_back(block("focal", "px", VectorXd::Constant(1, 0.1 * width),
                           VectorXd::Constant(1, 50.0 * width), 0.05 * camera.focal_px.x()));
  }
  if (freedom.principal) {
    blocks.push_back(block("principal", "px", Vector2d::Zero(),
                           Vector2d(camera.width, camera.height), 0.02 * width));
  }
  if (freedom.distortion && camera.lens != Lens::pinhole) {
    const int count = coefficient_count(camera.lens);
    blocks.push_back(block("distortion", "1", VectorXd::Constant(count, -5.0),
                           VectorXd::Constant(count, 5.0), 0.05));
  }
  constexpr double rotation_step_rad = 0.05;
  for (std::size_t k = 0; k < start.size(); ++k) {
    ParameterBlock rotation = rotation_block("rotation" + std::to_string(k), "camera_from_object");
    rotation.prior_sigma = Vector3d::Constant(rotation_step_rad);
    blocks.push_back(rotation);
    ParameterBlock shift =
        translation_block("translation" + std::to_string(k), kFarthest_m, "camera_from_object");
    shift.prior_sigma = Vector3d::Constant(0.05 * std::max(start[k].translation_m.norm(), 1e-6));
    blocks.push_back(shift);
  }
  return ParameterSpace(std::move(blocks));
}

VectorXd pack(const Camera& camera, const IntrinsicsFreedom& freedom,
              const std::vector<Rigid3>& poses, Eigen::Index size) {
  VectorXd x(size);
  Eigen::Index i = 0;
  if (freedom.focal) x[i++] = camera.focal_px.x();
  if (freedom.principal) {
    x.segment<2>(i) = camera.principal_px;
    i += 2;
  }
  for (int k = 0; freedom.distortion && k < coefficient_count(camera.lens); ++k) {
    x[i++] = camera.distortion[static_cast<std::size_t>(k)];
  }
  for (const Rigid3& pose : poses) {
    const Eigen::Quaterniond& q = pose.rotation;
    x.segment<7>(i) << q.w(), q.x(), q.y(), q.z(), pose.translation_m;
    i += 7;
  }
  return x;
}

/// Geman-McClure's loss of a residual in deviations: cost, and the weight of residual and
/// curvature.
struct Robust {
  double cost, weight;
};
Robust robust(double square) {
  const double q = 1.0 / (1.0 + square / (kPairWidth * kPairWidth));
  return {0.5 * square * q, q * q};
}

}  // namespace

PointMotion point_motion(const Camera& camera, const IntrinsicsFreedom& freedom,
                         const Rigid3& camera_from_object, const Vector3d& point_m) {
  const Vector3d turned = camera_from_object.rotation * point_m;
  const Vector3d seen = turned + camera_from_object.translation_m;
  const Vector2d direction = seen.head<2>() / seen.z();
  const LensPoint lens = distort(camera.lens, camera.distortion, direction);
  PointMotion out;
  out.pixel_px = camera.focal_px.cwiseProduct(lens.point) + camera.principal_px;
  const int intrinsics = freedom.count(camera.lens);
  out.by_parameters.resize(2, intrinsics + 6);
  int i = 0;
  if (freedom.focal) {
    const double aspect = camera.focal_px.y() / camera.focal_px.x();
    out.by_parameters.col(i++) << lens.point.x(), aspect * lens.point.y();
  }
  if (freedom.principal) {
    out.by_parameters.middleCols<2>(i).setIdentity();
    i += 2;
  }
  if (freedom.distortion) {
    out.by_parameters.middleCols(i, intrinsics - i) =
        camera.focal_px.asDiagonal() * lens.d_coefficients.leftCols(intrinsics - i);
  }
  Eigen::Matrix<double, 2, 3> d_direction;
  d_direction << 1.0, 0.0, -direction.x(), 0.0, 1.0, -direction.y();
  const Eigen::Matrix<double, 2, 3> d_seen =
      camera.focal_px.asDiagonal() * lens.d_direction * d_direction / seen.z();
  out.by_parameters.middleCols<3>(intrinsics) = -d_seen * cross_matrix(turned);
  out.by_parameters.rightCols<3>() = d_seen;
  return out;
}

PointMotion PictureView::motion(const Vector3d& point_m) const {
  PointMotion out = point_motion(camera, freedom, camera_from_object, point_m);
  // The focal length and the principal point are those of the full picture.
  const int pixels = static_cast<int>(freedom.focal) + 2 * static_cast<int>(freedom.principal);
  out.by_parameters.leftCols(pixels) *= scale;
  return out;
}

struct ObjectWorkspace::Buffers {
  explicit Buffers(const SurfaceTopology* topology) : equations(topology) {}
  std::mutex mutex;  // one synthesis of a picture at a time
  Scene scene;
  Rasteriser rasteriser{Rasteriser::Instructions::best, Rasteriser::Faces::front};
  VisiblePixels pixels;
  SurfaceEquations equations;
  SurfaceEquations::Motion motion;
};

ObjectWorkspace::ObjectWorkspace(const ObjectTarget& target, std::size_t pictures)
    : target_(target) {
  const auto mesh = std::make_shared<Mesh>(target.mesh);
  for (std::size_t k = 0; k < pictures; ++k) {
    buffers_.push_back(std::make_unique<Buffers>(&target.topology));
    SceneObject object;
    object.name = "object";
    object.mesh = mesh;
    buffers_.back()->scene.objects.push_back(std::move(object));
  }
}

ObjectWorkspace::~ObjectWorkspace() = default;

ObjectObjective::ObjectObjective(const ObjectWorkspace& workspace, const Camera& camera,
                                 const IntrinsicsFreedom& freedom, std::vector<PictureTerms> terms,
                                 const std::vector<Rigid3>& start)
    : workspace_(workspace),
      camera_(camera),
      freedom_(freedom),
      intrinsics_(freedom.count(camera.lens)),
      terms_(std::move(terms)),
      space_(make_space(camera, freedom, start)),
      start_(pack(camera, freedom, start, space_.size())) {
  camera_.camera_from_world = {};
}

Camera ObjectObjective::camera(const VectorXd& x) const {
  Camera out = camera_;
  Eigen::Index i = 0;
  if (freedom_.focal) {
    const double aspect = camera_.focal_px.y() / camera_.focal_px.x();
    out.focal_px = Vector2d(x[0], aspect * x[0]);
    ++i;
  }
  if (freedom_.principal) {
    out.principal_px = x.segment<2>(i);
    i += 2;
  }
  for (int k = 0; freedom_.distortion && k < coefficient_count(out.lens); ++k) {
    out.distortion[static_cast<std::size_t>(k)] = x[i++];
  }
  return out;
}

Rigid3 ObjectObjective::pose(const VectorXd& x, std::size_t picture) const {
  const Eigen::Index i = intrinsics_ + 7 * static_cast<Eigen::Index>(picture);
  return {Eigen::Quaterniond(x[i], x[i + 1], x[i + 2], x[i + 3]).normalized(), x.segment<3>(i + 4)};
}

std::vector<int> ObjectObjective::columns(std::size_t picture) const {
  std::vector<int> out;
  for (int k = 0; k < intrinsics_; ++k) out.push_back(k);
  for (int k = 0; k < 6; ++k) out.push_back(intrinsics_ + 6 * static_cast<int>(picture) + k);
  return out;
}

void ObjectObjective::synthesize(const VectorXd& x, std::size_t picture, Scene& scene) const {
  const ObjectTarget& target = workspace_.target();
  const Rigid3 place = pose(x, picture);
  const Camera lens = camera(x);
  const Matrix3d turn = place.rotation.toRotationMatrix();
  SceneObject& object = scene.objects.front();
  object.positions_m.resize(target.mesh.vertex_count(), 3);
  for (Eigen::Index v = 0; v < target.mesh.vertex_count(); ++v) {
    Vector3d seen = turn * target.mesh.positions_m.row(v).transpose() + place.translation_m;
    if (lens.lens != Lens::pinhole && seen.z() > 0.0) {
      seen.head<2>() =
          seen.z() * distort(lens.lens, lens.distortion, seen.head<2>() / seen.z()).point;
    }
    object.positions_m.row(v) = seen.cast<float>();
  }
  object.normals = target.normals * turn.transpose().cast<float>();
  scene.light = terms_[picture].light;
}

void ObjectObjective::with_synthesis(const VectorXd& x, std::size_t picture,
                                     const std::function<void(const Synthesis&)>& use) const {
  ObjectWorkspace::Buffers& buffers = workspace_.of(picture);
  const std::lock_guard lock(buffers.mutex);
  synthesize(x, picture, buffers.scene);
  const Camera straight = camera(x).without_distortion().scaled(terms_[picture].scale);
  buffers.rasteriser.visible_pixels(buffers.scene, straight, nullptr, buffers.pixels);
  use({space_, x, buffers.scene, straight, buffers.pixels,
       buffers.rasteriser.projected_vertices()});
}

double ObjectObjective::pairs_cost(const VectorXd& x, std::size_t picture) const {
  const PictureTerms& terms = terms_[picture];
  const Camera lens = camera(x);
  const Rigid3 place = pose(x, picture);
  double cost = 0.0;
  for (const ObjectPair& pair : terms.pairs) {
    const Vector3d seen = place * pair.point_m;
    if (!(seen.z() > 0.0)) return std::numeric_limits<double>::infinity();
    const Vector2d residual = (project(lens, seen) - pair.pixel_px) / terms.pair_sigma_px;
    cost += robust(residual.squaredNorm()).cost;
  }
  return cost;
}

void ObjectObjective::add_pairs(const VectorXd& x, std::size_t picture,
                                NormalEquations& out) const {
  const PictureTerms& terms = terms_[picture];
  const Camera lens = camera(x);
  const Rigid3 place = pose(x, picture);
  for (const ObjectPair& pair : terms.pairs) {
    const PointMotion motion = point_motion(lens, freedom_, place, pair.point_m);
    const Vector2d residual = (motion.pixel_px - pair.pixel_px) / terms.pair_sigma_px;
    const auto jacobian = motion.by_parameters / terms.pair_sigma_px;
    const double weight = robust(residual.squaredNorm()).weight;
    out.hessian += weight * jacobian.transpose() * jacobian;
    out.gradient += weight * jacobian.transpose() * residual;
  }
  out.cost += pairs_cost(x, picture);
}

Eigen::MatrixXd ObjectObjective::pairs_information(const VectorXd& x) const {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(space_.tangent_size(), space_.tangent_size());
  for (std::size_t k = 0; k < terms_.size(); ++k) {
    NormalEquations part;
    part.reset(intrinsics_ + 6);
    add_pairs(x, k, part);
    const std::vector<int> at = columns(k);
    out(at, at) += part.hessian;
  }
  return out;
}

PictureView ObjectObjective::view(const VectorXd& x, std::size_t picture) const {
  const double scale = terms_[picture].scale;
  return {camera(x).scaled(scale), freedom_, pose(x, picture), scale};
}

void ObjectObjective::add_cost(const VectorXd& x, std::size_t picture, const Synthesis& synthesis,
                               const Cost& cost, NormalEquations& out) const {
  ObjectWorkspace::Buffers& buffers = workspace_.of(picture);
  buffers.equations.reset();
  out.cost += cost.evaluate(synthesis, &buffers.equations, &out);
  if (!std::isfinite(out.cost)) return;
  const std::vector<int>& vertices = buffers.equations.touched_vertices();
  const PictureView seen = view(x, picture);
  const Eigen::Index count = seen.parameters();
  buffers.motion.setZero(2 * static_cast<Eigen::Index>(vertices.size()),
                         SurfaceEquations::padded_columns(count));
  const auto& positions = workspace_.target().mesh.positions_m;
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    buffers.motion.block(2 * static_cast<Eigen::Index>(i), 0, 2, count) =
        seen.motion(positions.row(vertices[i]).transpose()).by_parameters.cast<float>();
  }
  buffers.equations.assemble(buffers.motion, out);
}

double ObjectObjective::evaluate(const VectorXd& x) const {
  std::vector<double> parts(terms_.size(), 0.0);
  parallel_for(terms_.size(), [&](std::size_t k) {
    parts[k] = pairs_cost(x, k);
    const PictureTerms& terms = terms_[k];
    if ((terms.outline == nullptr && terms.colours == nullptr) || !std::isfinite(parts[k])) return;
    with_synthesis(x, k, [&](const Synthesis& synthesis) {
      if (terms.outline != nullptr) parts[k] += terms.outline->cost(synthesis);
      if (terms.colours != nullptr) {
        parts[k] += terms.colours->evaluate(view(x, k), synthesis, nullptr);
      }
    });
  });
  double total = 0.0;
  for (const double part : parts) total += part;
  return std::isfinite(total) ? total : std::numeric_limits<double>::infinity();
}

bool ObjectObjective::normal_equations(const VectorXd& x, NormalEquations& out) const {
  std::vector<NormalEquations> parts(terms_.size());
  parallel_for(terms_.size(), [&](std::size_t k) {
    parts[k].reset(intrinsics_ + 6);
    add_pairs(x, k, parts[k]);
    const PictureTerms& terms = terms_[k];
    if (terms.outline == nullptr && terms.colours == nullptr) return;
    if (!std::isfinite(parts[k].cost)) return;
    with_synthesis(x, k, [&](const Synthesis& synthesis) {
      if (terms.outline != nullptr) terms.outline->add(*this, x, k, synthesis, parts[k]);
      if (terms.colours != nullptr) {
        parts[k].cost += terms.colours->evaluate(view(x, k), synthesis, &parts[k]);
      }
    });
  });
  out.reset(space_.tangent_size());
  for (std::size_t k = 0; k < parts.size(); ++k) {
    const std::vector<int> at = columns(k);
    out.cost += parts[k].cost;
    out.hessian(at, at) += parts[k].hessian;
    out.gradient(at) += parts[k].gradient;
  }
  return std::isfinite(out.cost);
}

}  // namespace semblance
