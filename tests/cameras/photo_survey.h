// Photos of marks with a known truth, and starts far from it.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "survey_maker.h"

namespace semblance::testing {

// A cloth over a table, 60 x 48 cm with 25 marks, in six photos from around it.
inline Survey draped_marks(Random& random) {
  Survey truth;
  Camera camera = Camera::centred(1600, 1200, 1800.0);
  camera.camera_from_world = {};
  truth.cameras = {camera};
  for (int row = -2; row <= 2; ++row) {
    for (int column = -2; column <= 2; ++column) {
      const double x = 0.15 * column, y = 0.12 * row;
      const double over = std::max({0.0, std::abs(x) - 0.2, std::abs(y) - 0.15});
      truth.points_m.emplace_back(x + 0.02 * random.normal(), y + 0.02 * random.normal(),
                                  -1.5 * over + 0.03 * std::sin(12.0 * (x + y)));
    }
  }
  constexpr int photos = 6;
  for (int i = 0; i < photos; ++i) {
    const double azimuth = 2.0 * std::numbers::pi * i / photos + 0.2 * random.normal();
    const double height = 0.7 + 0.15 * random.normal();
    const Eigen::Vector3d at =
        1.8 * Eigen::Vector3d(std::cos(azimuth) * std::cos(height),
                              std::sin(azimuth) * std::cos(height), std::sin(height));
    const Eigen::Vector3d forward = -at.normalized();
    const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
    Eigen::Matrix3d rotation;
    rotation << right.transpose(), forward.cross(right).transpose(), forward.transpose();
    truth.world_from_target.push_back({Eigen::Quaterniond(rotation), -rotation * at});
  }
  add_sightings(truth, random, 0.5);
  return truth;
}

// The truth with poses 20 degrees, the focal length 30 % and the points off.
inline Survey far_start(const Survey& truth, Random& random, bool longer, double points_off_m) {
  Survey start = truth;
  start.cameras[0].focal_px *= longer ? 1.3 : 0.7;
  for (Rigid3& pose : start.world_from_target) {
    const Eigen::Vector3d axis = normal_vector(random, 1.0).normalized();
    pose.rotation =
        quaternion_from_rotation_vector(20.0 * std::numbers::pi / 180.0 * axis) * pose.rotation;
  }
  for (Eigen::Vector3d& point : start.points_m) point += normal_vector(random, points_off_m);
  return start;
}

// Root mean squared distance of the points from the truth after the best similarity.
inline double shape_error_m(const Survey& found, const Survey& truth) {
  const auto columns = [](const Survey& survey) {
    Eigen::Matrix3Xd points(3, static_cast<Eigen::Index>(survey.points_m.size()));
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
      points.col(i) = survey.points_m[static_cast<std::size_t>(i)];
    }
    return points;
  };
  const Eigen::Matrix3Xd from = columns(found), to = columns(truth);
  const Eigen::Matrix4d similarity = Eigen::umeyama(from, to, true);
  const Eigen::Matrix3Xd moved =
      (similarity.topLeftCorner<3, 3>() * from).colwise() + similarity.topRightCorner<3, 1>();
  return std::sqrt((moved - to).colwise().squaredNorm().mean());
}

}  // namespace semblance::testing
