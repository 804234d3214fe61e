#include "mouth_sheet.h"

#include <algorithm>
#include <cmath>

#include "semblance/geometry/similarity.h"

namespace semblance {
namespace {

using Eigen::Vector2d;

constexpr int ring_count = 20, upper_lip_markers = 5;  // markers 0 to 4
// In widths of the mouth.
constexpr double near_reach = 1.0, chin_reach = 0.7, far_reach = 4.0, cavity_depth = 0.1;

/// From 1 to 0 over [0, 1], flat at both ends.
double fade(double x) {
  const double t = std::clamp(x, 0.0, 1.0);
  return 1.0 - t * t * (3.0 - 2.0 * t);
}

std::vector<Vector2d> in_picture(const MouthPoints& markers) {
  std::vector<Vector2d> list;
  for (const auto& row : markers.rowwise()) list.emplace_back(row.x(), row.y());
  return list;
}

/// The head's motion in the picture.
Eigen::Affine2d head_motion(const MouthPoints& from, const MouthPoints& to) {
  const Eigen::Matrix2Xd a = from.topLeftCorner<upper_lip_markers, 2>().transpose();
  const Eigen::Matrix2Xd b = to.topLeftCorner<upper_lip_markers, 2>().transpose();
  return fit_similarity(a, b, false);
}

}  // namespace

MouthSheet::MouthSheet(const MouthWireframe& wireframe, const MouthPoints& markers)
    : wireframe_(wireframe), rest_markers_(markers) {
  MouthPoints lips;
  wireframe_.evaluate(markers, lips);
  const int ring = wireframe_.ring_size();
  rest_px_.resize(wireframe_.point_count() + (ring_count + 1) * ring, 3);
  rest_px_.topRows(lips.rows()) = lips;
  lay_rings(lips);
  rest_px_.bottomRows(ring) = lips.bottomRows(ring);
  rest_px_.bottomRows(ring).col(2).array() -= cavity_depth_px_;
  make_triangles();
}

void MouthSheet::lay_rings(const MouthPoints& lips) {
  const MouthFrame frame = mouth_frame(in_picture(rest_markers_));
  const int ring = wireframe_.ring_size();
  const Vector2d centre = lips.topRows(ring).leftCols<2>().colwise().mean();
  cavity_depth_px_ = cavity_depth * frame.width_px;
  near_share_.resize(ring, ring_count);
  far_share_.resize(ring_count);
  for (int j = 0; j < ring_count; ++j) {
    // Dense at the lips.
    const double fraction = double(j + 1) / ring_count;
    const double distance = far_reach * fraction * fraction;
    far_share_[j] = fade(distance / far_reach);
    for (int k = 0; k < ring; ++k) {
      const Vector2d lip = lips.row(k).head<2>();
      const Vector2d outwards = (lip - centre).normalized();
      const double reach = near_reach + chin_reach * std::max(0.0, outwards.dot(frame.down));
      near_share_(k, j) = fade(distance / reach);
      const Vector2d place = lip + distance * frame.width_px * outwards;
      rest_px_.row(ring_start(j) + k) << place.x(), place.y(), near_share_(k, j) * lips(k, 2);
    }
  }
}

int MouthSheet::ring_start(int ring) const {
  return wireframe_.point_count() + ring * wireframe_.ring_size();
}

int MouthSheet::skin_triangle_count() const { return 2 * ring_count * wireframe_.ring_size(); }

void MouthSheet::make_triangles() {
  const int ring = wireframe_.ring_size();
  triangles_.resize(lip_triangle_count() + skin_triangle_count() + ring - 2, 3);
  triangles_.topRows(lip_triangle_count()) = wireframe_.triangles();
  int t = lip_triangle_count();
  for (int j = 0; j < ring_count; ++j) {
    const int outer = ring_start(j), inner = j == 0 ? 0 : ring_start(j - 1);
    for (int k = 0; k < ring; ++k) {
      const int next = (k + 1) % ring;
      triangles_.row(t++) << outer + k, inner + k, outer + next;
      triangles_.row(t++) << outer + next, inner + k, inner + next;
    }
  }
  // Strips from the upper to the lower lip: a bent opening is not seen from one point.
  const int cavity = ring_start(ring_count), half = ring / 2;
  for (int k = 0; k < half; ++k) {
    const int a = cavity + k, b = cavity + k + 1;
    const int c = cavity + (ring - k) % ring, d = cavity + ring - k - 1;
    if (a != c) triangles_.row(t++) << a, c, b;
    if (b != d) triangles_.row(t++) << b, c, d;
  }
}

void MouthSheet::move(const MouthPoints& markers, MouthPoints& points_px) const {
  const int ring = wireframe_.ring_size(), lip_points = wireframe_.point_count();
  MouthPoints lips;
  wireframe_.evaluate(markers, lips);
  points_px.resize(rest_px_.rows(), 3);
  points_px.topRows(lip_points) = lips;
  points_px.bottomRows(ring) = lips.bottomRows(ring);
  points_px.bottomRows(ring).col(2).array() -= cavity_depth_px_;
  const Eigen::Affine2d head = head_motion(rest_markers_, markers);
  for (int k = 0; k < ring; ++k) {
    const Vector2d lip = rest_px_.row(k).head<2>();
    const Vector2d own = lips.row(k).head<2>().transpose() - head * lip;
    for (int j = 0; j < ring_count; ++j) {
      const int row = ring_start(j) + k;
      const Vector2d place = rest_px_.row(row).head<2>();
      const Vector2d moved =
          place + near_share_(k, j) * own + far_share_[j] * (head * place - place);
      points_px.row(row) << moved.x(), moved.y(), near_share_(k, j) * lips(k, 2);
    }
  }
}

}  // namespace semblance
