#include "semblance/models/mouth_wireframe.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "semblance/core/errors.h"
#include "semblance/geometry/contour.h"

namespace semblance {
namespace {

constexpr int contour_markers = 8, most_points_between = 1000;

void require(const MouthWireframeOptions& options) {
  const auto& [first, second] = options.fibres;
  if (!(first > 0.0 && first < second && second < 1.0)) {
    throw InvalidInput(fmt::format(
        "fibre proportions {} and {} must increase between 0 and 1; 1/3 and 2/3 are even", first,
        second));
  }
  if (options.points_between < 0 || options.points_between > most_points_between) {
    throw InvalidInput(fmt::format("{} points between markers; 0 to {} were expected",
                                   options.points_between, most_points_between));
  }
}

/// Angles in [0, 2 pi) whose gaps are as the square roots of the distances between neighbouring
/// markers (centripetal: no loops where these differ much).
Eigen::VectorXd knot_angles(const MouthPoints& markers) {
  Eigen::VectorXd gaps(contour_markers);
  for (int i = 0; i < contour_markers; ++i) {
    const int next = (i + 1) % contour_markers;
    gaps[i] =
        std::sqrt((markers.row(next) - markers.row(i)).norm() +
                  (markers.row(contour_markers + next) - markers.row(contour_markers + i)).norm());
    if (!(gaps[i] > 0.0)) {
      throw InvalidInput(
          fmt::format("lip markers {} and {} are at one place; correct them or "
                      "choose other key frames",
                      i, next));
    }
  }
  gaps *= 2.0 * std::numbers::pi / gaps.sum();
  Eigen::VectorXd angles = Eigen::VectorXd::Zero(contour_markers);
  for (int i = 1; i < contour_markers; ++i) angles[i] = angles[i - 1] + gaps[i - 1];
  return angles;
}

Eigen::MatrixXd linear_weights(int steps) {
  Eigen::MatrixXd weights = Eigen::MatrixXd::Zero(contour_markers * steps, contour_markers);
  for (int i = 0; i < contour_markers; ++i) {
    for (int k = 0; k < steps; ++k) {
      const double t = double(k) / steps;
      weights(i * steps + k, i) = 1.0 - t;
      weights(i * steps + k, (i + 1) % contour_markers) = t;
    }
  }
  return weights;
}

/// A spline is linear in its values: column i holds the one through 1 at knot i and 0 elsewhere.
Eigen::MatrixXd smooth_weights(int steps, const Eigen::VectorXd& angles) {
  Eigen::MatrixXd weights(contour_markers * steps, contour_markers);
  for (int column = 0; column < contour_markers; ++column) {
    const PeriodicContour spline(angles, Eigen::VectorXd::Unit(contour_markers, column));
    for (int i = 0; i < contour_markers; ++i) {
      const double next =
          i + 1 < contour_markers ? angles[i + 1] : angles[0] + 2.0 * std::numbers::pi;
      for (int k = 0; k < steps; ++k) {
        weights(i * steps + k, column) =
            spline.at(angles[i] + (next - angles[i]) * double(k) / steps).value;
      }
    }
  }
  return weights;
}

}  // namespace

MouthWireframe::MouthWireframe(const MouthPoints& markers, const MouthWireframeOptions& options)
    : proportions_{0.0, options.fibres[0], options.fibres[1], 1.0} {
  require(options);
  if (markers.rows() != 2 * contour_markers || !markers.allFinite()) {
    throw InvalidInput("mouth wireframe: 16 finite lip markers were expected");
  }
  const int steps = options.points_between + 1;
  ring_from_markers_ = options.between == MouthWireframeOptions::Between::linear
                           ? linear_weights(steps)
                           : smooth_weights(steps, knot_angles(markers));
  const int ring = ring_size();
  triangles_.resize(2 * ring * (contour_count - 1), 3);
  int t = 0;
  for (int c = 0; c + 1 < contour_count; ++c) {
    for (int k = 0; k < ring; ++k) {
      const int a = c * ring + k, b = c * ring + (k + 1) % ring;
      triangles_.row(t++) << a, a + ring, b;
      triangles_.row(t++) << b, a + ring, b + ring;
    }
  }
}

int MouthWireframe::index(int contour, int marker, int between) const {
  return contour * ring_size() + marker * (ring_size() / contour_markers) + between;
}

void MouthWireframe::evaluate(const MouthPoints& markers, MouthPoints& points) const {
  const int ring = ring_size();
  points.resize(point_count(), 3);
  for (int c = 0; c < contour_count; ++c) {
    const Eigen::Matrix<double, contour_markers, 3> between =
        (1.0 - proportions_[c]) * markers.topRows<contour_markers>() +
        proportions_[c] * markers.bottomRows<contour_markers>();
    points.middleRows(c * ring, ring).noalias() = ring_from_markers_ * between;
  }
}

Eigen::Matrix<float, Eigen::Dynamic, 2, Eigen::RowMajor> picture_uvs(const MouthPoints& points_px,
                                                                     int width, int height) {
  Eigen::Matrix<float, Eigen::Dynamic, 2, Eigen::RowMajor> uvs(points_px.rows(), 2);
  uvs.col(0) = (points_px.col(0) / width).cast<float>();
  uvs.col(1) = (1.0 - points_px.col(1).array() / height).cast<float>();
  return uvs;
}

}  // namespace semblance
