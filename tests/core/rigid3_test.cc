#include "semblance/core/rigid3.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/calib3d.hpp>

#include "semblance/core/random.h"

namespace semblance {
namespace {

const double angles[] = {0.0, 1e-300, 1e-20,    1e-9, 1e-8,        1e-7,        1e-4,
                         0.3, 1.0,    M_PI / 2, 3.0,  M_PI - 1e-6, M_PI - 1e-12};

Eigen::Vector3d random_axis(Random& random) { return random.normal_vector(3).normalized(); }

TEST(RotationVector, ExponentialAgreesWithOpencvsRodrigues) {
  Random random(1);
  for (const double angle : angles) {
    const Eigen::Vector3d w = angle * random_axis(random);
    cv::Mat theirs;
    cv::Rodrigues(cv::Vec3d(w.x(), w.y(), w.z()), theirs);
    const Eigen::Matrix3d ours = quaternion_from_rotation_vector(w).toRotationMatrix();
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) EXPECT_NEAR(ours(i, j), theirs.at<double>(i, j), 4e-15);
    }
  }
}

TEST(RotationVector, LogarithmInvertsExponential) {
  Random random(2);
  for (const double angle : angles) {
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector3d w = angle * random_axis(random);
      const Eigen::Quaterniond q = quaternion_from_rotation_vector(w);
      EXPECT_NEAR(q.norm(), 1.0, 1e-15);
      // Relative: a rotation of 1e-9 keeps all its digits. Near pi they stay absolute.
      EXPECT_LE((rotation_vector_from_quaternion(q) - w).norm(), 2e-15 * angle) << angle;
      const Eigen::Quaterniond same(-q.coeffs());
      EXPECT_LE((rotation_vector_from_quaternion(same) - w).norm(), 2e-15 * angle) << angle;
    }
  }
}

TEST(RotationVector, IsTheShortest) {
  const Eigen::Vector3d w(0.0, 0.0, 1.5 * M_PI);
  const Eigen::Vector3d back = rotation_vector_from_quaternion(quaternion_from_rotation_vector(w));
  EXPECT_NEAR(back.z(), -0.5 * M_PI, 1e-14);
  const Eigen::Vector3d half_turn =
      rotation_vector_from_quaternion(Eigen::Quaterniond(0.0, 0.0, -1.0, 0.0));
  EXPECT_DOUBLE_EQ(half_turn.norm(), M_PI);
}

TEST(Rigid3, ComposesAndInverts) {
  Random random(3);
  const Rigid3 b_from_a{quaternion_from_rotation_vector(random.normal_vector(3)),
                        random.normal_vector(3)};
  const Rigid3 c_from_b{quaternion_from_rotation_vector(random.normal_vector(3)),
                        random.normal_vector(3)};
  const Eigen::Vector3d point = random.normal_vector(3);
  const auto matrix = [](const Rigid3& rigid) {
    Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
    m.topLeftCorner<3, 3>() = rigid.rotation.toRotationMatrix();
    m.topRightCorner<3, 1>() = rigid.translation_m;
    return m;
  };
  EXPECT_TRUE((b_from_a * point).homogeneous().isApprox(matrix(b_from_a) * point.homogeneous()));
  EXPECT_TRUE(matrix(c_from_b * b_from_a).isApprox(matrix(c_from_b) * matrix(b_from_a), 1e-14));
  EXPECT_TRUE(matrix(b_from_a.inverse()).isApprox(matrix(b_from_a).inverse(), 1e-14));
}

}  // namespace
}  // namespace semblance
