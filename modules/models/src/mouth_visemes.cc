#include "semblance/models/mouth_visemes.h"

#include <cmath>
#include <limits>
#include <utility>

#include "semblance/core/errors.h"
#include "semblance/geometry/similarity.h"
#include "semblance/models/face.h"
#include "semblance/models/lip_points.h"

namespace semblance {
namespace {

constexpr double coarse_density = 0.5;  // enough for 16 points

struct Articulation {
  const char* name;
  std::vector<std::pair<const char*, double>> values;
};

const std::vector<Articulation>& articulations() {
  static const std::vector<Articulation> list{
      {"rest", {}},
      {"a", {{"jaw_open", 0.75}, {"mouth_stretch_left", 0.2}, {"mouth_stretch_right", 0.2}}},
      {"i",
       {{"jaw_open", 0.12},
        {"mouth_stretch_left", 0.7},
        {"mouth_stretch_right", 0.7},
        {"mouth_smile_left", 0.2},
        {"mouth_smile_right", 0.2}}},
      {"o", {{"jaw_open", 0.4}, {"mouth_funnel", 0.7}}},
      {"u", {{"jaw_open", 0.12}, {"mouth_pucker", 0.8}, {"mouth_funnel", 0.3}}}};
  return list;
}

Eigen::VectorXd parameter_values(const MorphShape& shape, const Articulation& articulation) {
  Eigen::VectorXd values =
      Eigen::VectorXd::Zero(static_cast<Eigen::Index>(shape.parameters.size()));
  for (const auto& [name, value] : articulation.values) {
    for (std::size_t i = 0; i < shape.parameters.size(); ++i) {
      if (shape.parameters[i].name == name) values[static_cast<Eigen::Index>(i)] = value;
    }
  }
  return values;
}

Eigen::Vector3d landmark_in(const PointsF& positions_m, const MorphShape& shape, int ibug) {
  const ModelLandmark& landmark = shape.landmarks[ibug];
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    const int vertex = shape.mesh->triangles(landmark.triangle, k);
    point += landmark.barycentric[k] * positions_m.row(vertex).transpose().cast<double>();
  }
  return point;
}

double mean_depth_m(const std::vector<Viseme>& visemes) {
  double sum = 0.0;
  for (const Viseme& viseme : visemes) {
    for (const Eigen::Vector3d& marker : viseme.markers_m) sum += marker.z();
  }
  return sum / (Viseme::marker_count * static_cast<double>(visemes.size()));
}

VisemeMatch match(const Viseme& viseme, const std::vector<Eigen::Vector2d>& markers_px) {
  Eigen::Matrix2Xd from(2, Viseme::marker_count), to(2, Viseme::marker_count);
  for (int i = 0; i < Viseme::marker_count; ++i) {
    from.col(i) << viseme.markers_m[i].x(), -viseme.markers_m[i].y();
    to.col(i) = markers_px[i];
  }
  const Eigen::Affine2d to_from = fit_similarity(from, to);
  return {0, std::sqrt((to_from * from - to).squaredNorm() / Viseme::marker_count),
          to_from.linear().col(0).norm()};
}

}  // namespace

std::vector<Viseme> builtin_visemes() {
  const MorphShape shape = make_sweep_face({coarse_density});
  std::vector<Viseme> visemes;
  for (const Articulation& articulation : articulations()) {
    const PointsF positions = shape_positions(shape, parameter_values(shape, articulation));
    Viseme viseme{articulation.name, {}};
    std::vector<Eigen::Vector3d> landmarks;
    for (int ibug = 0; ibug < 68; ++ibug) {
      landmarks.push_back(landmark_in(positions, shape, ibug));
    }
    for (int i = 0; i < Viseme::marker_count; ++i) {
      viseme.markers_m.push_back(lip_point(landmarks, i));
    }
    visemes.push_back(std::move(viseme));
  }
  return visemes;
}

VisemeMatch closest_viseme(const std::vector<Viseme>& visemes,
                           const std::vector<Eigen::Vector2d>& markers_px) {
  VisemeMatch best;
  best.rms_px = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < visemes.size(); ++i) {
    VisemeMatch found = match(visemes[i], markers_px);
    if (!(found.rms_px < best.rms_px)) continue;
    best = found;
    best.viseme = static_cast<int>(i);
  }
  return best;
}

void assign_depths(const std::vector<Viseme>& visemes, std::vector<MouthKey>& keys) {
  if (visemes.empty()) throw InvalidInput("no viseme to take depths from");
  const double mean_m = mean_depth_m(visemes);
  for (MouthKey& key : keys) {
    const VisemeMatch match = closest_viseme(visemes, key.position_px);
    const Viseme& viseme = visemes[match.viseme];
    key.viseme = viseme.name;
    for (std::size_t i = 0; i < key.depth_px.size(); ++i) {
      key.depth_px[i] = match.scale_px_m * (viseme.markers_m[i].z() - mean_m);
    }
  }
}

}  // namespace semblance
