#include "marker_views.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

struct SeenFace {
  const Camera* camera = nullptr;
  Rigid3 camera_from_object;
  const Dot* dot = nullptr;
};

/// One view of a face: its flattened disc, r^2 (I - n n'), seen across the ray. `across` has the
/// two directions, `shape` what the ellipse says of the disc in them, in square metres.
struct FaceView {
  Eigen::Matrix<double, 2, 3> across;
  Matrix2d shape;
  Vector3d towards;  // the camera
};

FaceView face_view(const Vector3d& centre_m, const SeenFace& seen) {
  const Vector3d centre = seen.camera_from_object * centre_m;
  const Vector3d ray = centre.normalized();
  const Vector3d right = Vector3d::UnitY().cross(ray).normalized();
  Eigen::Matrix<double, 2, 3> across;
  across << right.transpose(), ray.cross(right).transpose();
  // Pixels by metres across the ray, at the dot's centre.
  Matrix2d pixels;
  const double step = 1e-4 * centre.norm();
  for (int k = 0; k < 2; ++k) {
    const Vector3d arm = step * across.row(k).transpose();
    pixels.col(k) =
        (project(*seen.camera, centre + arm) - project(*seen.camera, centre - arm)) / (2.0 * step);
  }
  const Dot& dot = *seen.dot;
  const Vector2d major(std::cos(dot.angle_rad), std::sin(dot.angle_rad));
  const Vector2d minor(-major.y(), major.x());
  const Matrix2d ellipse = dot.major_px * dot.major_px * major * major.transpose() +
                           dot.minor_px * dot.minor_px * minor * minor.transpose();
  const Matrix2d metres = pixels.inverse();
  const Matrix3d turn = seen.camera_from_object.rotation.toRotationMatrix();
  return {across * turn, metres * ellipse * metres.transpose(), -turn.transpose() * ray};
}

/// The two normals that one ellipse says, towards the camera.
std::array<Vector3d, 2> normals_of(const FaceView& view) {
  const Eigen::SelfAdjointEigenSolver<Matrix2d> solver(view.shape);
  const double cosine =
      std::sqrt(std::clamp(solver.eigenvalues()[0] / solver.eigenvalues()[1], 0.0, 1.0));
  const double sine = std::sqrt(1.0 - cosine * cosine);
  const Vector3d minor = view.across.transpose() * solver.eigenvectors().col(0);
  return {cosine * view.towards + sine * minor, cosine * view.towards - sine * minor};
}

Eigen::VectorXd misfit(const Vector3d& normal, double radius, const std::vector<FaceView>& views) {
  Eigen::VectorXd result(3 * static_cast<Eigen::Index>(views.size()));
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Vector2d n = views[i].across * normal;
    const Matrix2d error =
        radius * radius * (Matrix2d::Identity() - n * n.transpose()) - views[i].shape;
    result.segment<3>(3 * static_cast<Eigen::Index>(i)) << error(0, 0), error(1, 1),
        std::sqrt(2.0) * error(0, 1);
  }
  return result;
}

struct FittedFace {
  DotFace face;
  double cost = std::numeric_limits<double>::infinity();
};

FittedFace fit_face(const Vector3d& start, double start_radius,
                    const std::vector<FaceView>& views) {
  constexpr int iterations = 10;
  FittedFace best{{start, start_radius}, misfit(start, start_radius, views).squaredNorm()};
  for (int i = 0; i < iterations; ++i) {
    const auto [normal, radius] = best.face;
    const Eigen::VectorXd now = misfit(normal, radius, views);
    // Steps: two turns of the normal, and a relative change of the radius.
    const Vector3d a = normal.unitOrthogonal(), b = normal.cross(a);
    constexpr double h = 1e-6;
    Eigen::MatrixX3d jacobian(now.size(), 3);
    jacobian.col(0) = (misfit((normal + h * a).normalized(), radius, views) - now) / h;
    jacobian.col(1) = (misfit((normal + h * b).normalized(), radius, views) - now) / h;
    jacobian.col(2) = (misfit(normal, radius * (1.0 + h), views) - now) / h;
    const Vector3d step = jacobian.colPivHouseholderQr().solve(-now);
    if (!step.allFinite() || step.head<2>().norm() > 0.5 || std::abs(step[2]) > 0.5) break;
    const DotFace next{(normal + step[0] * a + step[1] * b).normalized(), radius * (1.0 + step[2])};
    const double cost = misfit(next.normal, next.radius_m, views).squaredNorm();
    if (!(cost < best.cost)) break;
    best = {next, cost};
  }
  // Both signs fit alike; dots are seen from outside.
  Vector3d towards = Vector3d::Zero();
  for (const FaceView& view : views) towards += view.towards;
  if (best.face.normal.dot(towards) < 0.0) best.face.normal = -best.face.normal;
  return best;
}

/// Across what the nearest points say of the surface there, of either sign. None where they are
/// nearly in a line.
std::optional<Vector3d> normal_from_neighbours(const std::vector<Vector3d>& points_m,
                                               std::size_t index) {
  constexpr std::size_t neighbours = 7;  // itself among them
  constexpr double flat = 0.5;           // share of the spread across in that along
  if (points_m.size() < neighbours) return std::nullopt;
  std::vector<Vector3d> nearest = points_m;
  const Vector3d& centre = points_m[index];
  std::nth_element(nearest.begin(), nearest.begin() + neighbours, nearest.end(),
                   [&](const Vector3d& a, const Vector3d& b) {
                     return (a - centre).squaredNorm() < (b - centre).squaredNorm();
                   });
  nearest.resize(neighbours);
  Vector3d mean = Vector3d::Zero();
  for (const Vector3d& point : nearest) mean += point / static_cast<double>(neighbours);
  Matrix3d spread = Matrix3d::Zero();
  for (const Vector3d& point : nearest) spread += (point - mean) * (point - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(spread);
  const Vector3d sizes = solver.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  if (sizes[0] > flat * sizes[1]) return std::nullopt;
  return solver.eigenvectors().col(0);
}

/// `surface`: across the surface as the points around say it. It tells apart what the ellipses
/// leave open: a single view always fits two normals.
std::optional<DotFace> face_from_views(const Vector3d& centre_m, const std::vector<SeenFace>& seen,
                                       const std::optional<Vector3d>& surface) {
  constexpr std::size_t most_starts = 5;
  constexpr double clearly_worse = 4.0, alike = 0.98;  // cosine
  constexpr double clearly_nearer = 0.05;
  if (seen.empty()) return std::nullopt;
  std::vector<FaceView> views;
  for (const SeenFace& one : seen) views.push_back(face_view(centre_m, one));
  std::vector<FittedFace> fits;
  for (std::size_t i = 0; i < views.size(); i += 1 + views.size() / most_starts) {
    const double radius =
        std::sqrt(Eigen::SelfAdjointEigenSolver<Matrix2d>(views[i].shape).eigenvalues()[1]);
    if (!(radius > 0.0)) continue;
    for (const Vector3d& normal : normals_of(views[i])) {
      fits.push_back(fit_face(normal, radius, views));
    }
  }
  if (fits.empty()) return std::nullopt;
  const FittedFace best =
      *std::min_element(fits.begin(), fits.end(),
                        [](const FittedFace& a, const FittedFace& b) { return a.cost < b.cost; });
  const FittedFace* rival = nullptr;
  for (const FittedFace& other : fits) {
    if (other.face.normal.dot(best.face.normal) > alike) continue;
    if (rival == nullptr || other.cost < rival->cost) rival = &other;
  }
  const bool open =
      seen.size() == 1 || (rival != nullptr && rival->cost < clearly_worse * best.cost);
  if (!open || rival == nullptr) return best.face;
  if (!surface) return std::nullopt;
  const double gain =
      std::abs(best.face.normal.dot(*surface)) - std::abs(rival->face.normal.dot(*surface));
  if (std::abs(gain) < clearly_nearer) return std::nullopt;
  return gain > 0.0 ? best.face : rival->face;
}

}  // namespace

void check_sizes(const std::vector<MarkerPicture>& pictures,
                 const std::vector<std::string>& camera_names) {
  std::map<int, const MarkerPicture*> first;
  for (const MarkerPicture& picture : pictures) {
    const MarkerPicture& other = *first.try_emplace(picture.camera, &picture).first->second;
    if (picture.width == other.width && picture.height == other.height) continue;
    throw InvalidInput(fmt::format(
        "camera '{}': {} has {} x {} pixels, but {} has {} x {}: pictures of one camera must be of "
        "one size and upright alike",
        camera_names[static_cast<std::size_t>(picture.camera)], picture.name, picture.width,
        picture.height, other.name, other.width, other.height));
  }
}

void correct_for_perspective(Survey& survey, const std::vector<Vector2d>& measured_px,
                             const std::vector<std::optional<DotFace>>& faces) {
  for (std::size_t i = 0; i < survey.sightings.size(); ++i) {
    Sighting& sighting = survey.sightings[i];
    sighting.pixel_px = measured_px[i];
    const auto& face = faces[static_cast<std::size_t>(sighting.point)];
    if (!face) continue;
    const Camera& camera = survey.cameras[static_cast<std::size_t>(sighting.camera)];
    const Rigid3 camera_from_object =
        camera.camera_from_world *
        survey.world_from_target[static_cast<std::size_t>(sighting.placement)];
    const Disc disc{camera_from_object * survey.points_m[static_cast<std::size_t>(sighting.point)],
                    camera_from_object.rotation * face->normal, face->radius_m};
    if (disc.centre_m.z() > disc.radius_m) sighting.pixel_px -= centre_offset_px(camera, disc);
  }
}

std::vector<std::optional<DotFace>> faces_from_views(const Adjustment& adjustment,
                                                     const std::vector<const Dot*>& dots) {
  const Survey& survey = adjustment.survey;
  std::vector<std::vector<SeenFace>> seen(survey.points_m.size());
  for (std::size_t i = 0; i < survey.sightings.size(); ++i) {
    if (adjustment.outlier[i] != 0) continue;
    const Sighting& sighting = survey.sightings[i];
    const Camera& camera = survey.cameras[static_cast<std::size_t>(sighting.camera)];
    const Rigid3 camera_from_object =
        camera.camera_from_world *
        survey.world_from_target[static_cast<std::size_t>(sighting.placement)];
    seen[static_cast<std::size_t>(sighting.point)].push_back(
        {&camera, camera_from_object, dots[i]});
  }
  std::vector<std::optional<DotFace>> faces;
  for (std::size_t k = 0; k < seen.size(); ++k) {
    faces.push_back(
        face_from_views(survey.points_m[k], seen[k], normal_from_neighbours(survey.points_m, k)));
  }
  return faces;
}

double spread_of(const Dot& dot) { return dot.major_px / dot.minor_px; }

Eigen::Matrix2Xd centres_px(const std::vector<Dot>& dots) {
  Eigen::Matrix2Xd result(2, static_cast<Eigen::Index>(dots.size()));
  for (std::size_t i = 0; i < dots.size(); ++i) {
    result.col(static_cast<Eigen::Index>(i)) = dots[i].centre_px;
  }
  return result;
}

}  // namespace semblance
