#include "semblance/cameras/posit.h"

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "sheet_start.h"

namespace semblance {
namespace {

using Eigen::Matrix2Xd;
using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kPlane = 0.01;  // least share of the greatest spread of points in space
constexpr int kMostIterations = 200;

// Points about their middle, with their axes: by spread, greatest first.
struct Object {
  Vector3d middle;
  Matrix3Xd arms;  // points minus middle
  Matrix3d axes;   // columns
  Vector3d spread;
  Eigen::MatrixX3d pseudo;  // maps n image coordinates to the least-squares row
  bool flat() const { return !(spread[2] > kPlane * spread[0]); }
};

std::optional<Object> object_of(const Matrix3Xd& points) {
  if (points.cols() < 4 || !points.allFinite()) return std::nullopt;
  Object object;
  object.middle = points.rowwise().mean();
  object.arms = points.colwise() - object.middle;
  const Eigen::JacobiSVD<Matrix3Xd> svd(object.arms, Eigen::ComputeThinU | Eigen::ComputeThinV);
  object.axes = svd.matrixU();
  object.spread = svd.singularValues();
  object.pseudo =
      svd.matrixV() * object.spread.cwiseInverse().asDiagonal() * svd.matrixU().transpose();
  return object;
}

// Pose of the arms from the picture as scaled orthography would have it. The middle of the arms is
// zero, so the middle of the coordinates is its image.
Rigid3 linear_pose(const Object& object, const Matrix2Xd& straight) {
  const Eigen::Vector2d middle_image = straight.rowwise().mean();
  const Eigen::Matrix<double, 2, 3> rows =
      (straight.colwise() - middle_image) * object.pseudo;  // s i and s j
  const double scale = std::sqrt(rows.row(0).norm() * rows.row(1).norm());
  Matrix3d turn;
  turn.row(0) = rows.row(0).normalized();
  turn.row(1) = rows.row(1).normalized();
  turn.row(2) = turn.row(0).cross(turn.row(1));
  const Eigen::JacobiSVD<Matrix3d> svd(turn, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Matrix3d square = svd.matrixU() * svd.matrixV().transpose();
  return {Eigen::Quaterniond(square), middle_image.homogeneous() / scale};
}

double rms_px(const Camera& camera, const Rigid3& pose, const Matrix3Xd& points,
              const Matrix2Xd& pixels) {
  double sum = 0.0;
  for (Eigen::Index k = 0; k < points.cols(); ++k) {
    const Vector3d seen = pose * points.col(k);
    if (!(seen.z() > 0.0)) return std::numeric_limits<double>::infinity();
    sum += (project(camera, seen) - pixels.col(k)).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(points.cols()));
}

}  // namespace

std::optional<PositPose> posit(const Camera& camera, const Matrix3Xd& points_m,
                               const Matrix2Xd& pixels_px) {
  const std::optional<Object> object = object_of(points_m);
  if (!object || object->flat()) return std::nullopt;
  Matrix2Xd image(2, pixels_px.cols());
  for (Eigen::Index k = 0; k < image.cols(); ++k) {
    image.col(k) = unproject(camera, pixels_px.col(k)).head<2>();
  }
  if (!image.allFinite()) return std::nullopt;
  PositPose result;
  VectorXd depths = VectorXd::Zero(image.cols());  // of the arms, as shares of the middle's
  for (result.iterations = 1; result.iterations <= kMostIterations; ++result.iterations) {
    const VectorXd factors = VectorXd::Ones(depths.size()) + depths;
    const Rigid3 pose = linear_pose(*object, image * factors.asDiagonal());
    const VectorXd next = (pose.rotation.toRotationMatrix().row(2) * object->arms).transpose() /
                          pose.translation_m.z();
    const double change = (next - depths).cwiseAbs().maxCoeff();
    depths = next;
    result.camera_from_object = pose;
    if (!(change > 1e-12)) break;
  }
  Rigid3& pose = result.camera_from_object;
  pose.translation_m -= pose.rotation * object->middle;
  result.rms_px = rms_px(camera, pose, points_m, pixels_px);
  if (!std::isfinite(result.rms_px)) return std::nullopt;
  return result;
}

std::optional<Rigid3> pose_from_points(const Camera& camera, const Matrix3Xd& points_m,
                                       const Matrix2Xd& pixels_px) {
  const std::optional<Object> object = object_of(points_m);
  if (!object) return std::nullopt;
  if (!object->flat()) {
    const auto found = posit(camera, points_m, pixels_px);
    return found ? std::optional(found->camera_from_object) : std::nullopt;
  }
  Matrix3d axes = object->axes;
  if (axes.determinant() < 0.0) axes.col(2) *= -1.0;
  const Rigid3 plane_from_object = Rigid3{Eigen::Quaterniond(axes), object->middle}.inverse();
  const Matrix3Xd in_plane = axes.transpose() * object->arms;
  const auto pose = sheet_pose(camera, {in_plane.topRows<2>(), pixels_px});
  return pose ? std::optional(*pose * plane_from_object) : std::nullopt;
}

}  // namespace semblance
