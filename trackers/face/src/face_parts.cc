#include "face_parts.h"

#include <algorithm>
#include <cmath>

namespace semblance {

namespace {

struct PartFacts {
  Eigen::Vector3f albedo;
  float confidence, weight;
};

// Ratios to the skin of the cheek, round figures that hold from light to dark skin well enough to
// find the features; the first image replaces them.
PartFacts facts(FacePart part) {
  switch (part) {
    case FacePart::skin:
      return {{1.0f, 1.0f, 1.0f}, 0.4f, 1.0f};
    case FacePart::lips:
      return {{0.75f, 0.55f, 0.6f}, 0.4f, 1.0f};
    case FacePart::brow:
      return {{0.4f, 0.38f, 0.4f}, 0.35f, 1.0f};
    case FacePart::sclera:
      return {{0.9f, 1.1f, 1.3f}, 0.3f, 0.8f};
    case FacePart::iris:
      return {{0.2f, 0.22f, 0.25f}, 0.4f, 0.8f};
    case FacePart::pupil:
      return {{0.04f, 0.05f, 0.06f}, 0.4f, 0.8f};
    case FacePart::teeth:
      return {{0.8f, 1.0f, 1.1f}, 0.15f, 0.5f};
    case FacePart::mouth_cavity:
      return {{0.12f, 0.08f, 0.08f}, 0.25f, 0.5f};
    case FacePart::tongue:
      return {{0.6f, 0.4f, 0.4f}, 0.1f, 0.3f};
    case FacePart::nostril:
      return {{0.3f, 0.25f, 0.25f}, 0.2f, 0.7f};
    case FacePart::lashes:
      return {{0.25f, 0.25f, 0.28f}, 0.2f, 0.6f};
    case FacePart::ear:
      return {{0.95f, 0.85f, 0.85f}, 0.05f, 0.3f};
    case FacePart::hair:
      return {{0.25f, 0.25f, 0.25f}, 0.0f, 0.25f};
    case FacePart::neck:
      return {{0.9f, 0.9f, 0.9f}, 0.0f, 0.0f};
    case FacePart::other:
      return {{0.5f, 0.5f, 0.5f}, 0.0f, 0.0f};
  }
  return {{1.0f, 1.0f, 1.0f}, 0.0f, 0.0f};
}

FacePart part_of(const MorphShape& shape, int vertex) {
  return shape.part.empty() ? FacePart::skin
                            : static_cast<FacePart>(shape.part[static_cast<std::size_t>(vertex)]);
}

}  // namespace

double eye_distance_px(const Camera& camera, const Eigen::VectorXd& x) {
  const Eigen::Vector3d p = camera.camera_from_world * Eigen::Vector3d(x.segment<3>(4));
  return camera.focal_px.x() * kEyeDistance_m / std::max(p.z(), 1e-3);
}

int level_for(const Observation& observation, double eyes_px, double wanted_px) {
  const int level = static_cast<int>(std::floor(std::log2(std::max(eyes_px / wanted_px, 1.0))));
  return std::min(level, static_cast<int>(observation.levels.size()) - 1);
}

Eigen::Vector3f relative_albedo(FacePart part) { return facts(part).albedo; }
float colour_confidence(FacePart part) { return facts(part).confidence; }
float tracking_weight(FacePart part) { return facts(part).weight; }

PointsF vertex_albedo(const MorphShape& shape) {
  PointsF out(shape.mesh->vertex_count(), 3);
  for (int v = 0; v < out.rows(); ++v) out.row(v) = relative_albedo(part_of(shape, v)).transpose();
  return out;
}

std::vector<float> vertex_confidence(const MorphShape& shape) {
  std::vector<float> out(static_cast<std::size_t>(shape.mesh->vertex_count()));
  for (std::size_t v = 0; v < out.size(); ++v) {
    out[v] = colour_confidence(part_of(shape, static_cast<int>(v)));
  }
  return out;
}

std::vector<float> unseen_confidence(const MorphShape& shape) {
  constexpr float kUnseen = 0.25f;
  std::vector<float> confidence = vertex_confidence(shape);
  for (float& c : confidence) c *= kUnseen;
  return confidence;
}

std::vector<GenericColour> generic_colours(const MorphShape& shape,
                                           const SurfaceTopology& topology) {
  const PointsF albedo = vertex_albedo(shape);
  const std::vector<float> confidence = vertex_confidence(shape);
  std::vector<GenericColour> out;
  for (const auto& corner : topology.triangles) {
    GenericColour colour{Eigen::Vector3f::Zero(), 1.0f};
    for (int v : corner) {
      colour.encoded += albedo.row(v).transpose().cwiseSqrt() / 3.0f;
      colour.confidence = std::min(colour.confidence, confidence[static_cast<std::size_t>(v)]);
    }
    out.push_back(colour);
  }
  return out;
}

std::vector<float> inner_face_weight(const MorphShape& shape, const SurfaceTopology& topology) {
  std::vector<float> out;
  for (const auto& corner : topology.triangles) {
    float least = 1.0f;
    for (int vertex : corner) {
      const auto p = shape.mesh->positions_m.row(vertex);
      // An upright ellipse about the nose; the back half of the head does not count.
      const double rx = p.x() / 0.066, ry = (p.y() + 0.035) / 0.088;
      const double outside = std::sqrt(rx * rx + ry * ry) - 0.85;
      const double inside = p.z() < -0.03 ? 0.0 : 1.0 - outside / 0.3;
      least = std::min(least, static_cast<float>(std::clamp(inside, 0.0, 1.0)));
    }
    out.push_back(least);
  }
  return out;
}

std::vector<float> bare_face_weight(const MorphShape& shape, const SurfaceTopology& topology) {
  // Heights over the eyes between which foreheads end under somebody's hair.
  constexpr double kBare_m = 0.040, kCovered_m = 0.062;
  std::vector<float> out = triangle_weights(shape, topology, tracking_weight);
  for (std::size_t t = 0; t < out.size(); ++t) {
    for (int vertex : topology.triangles[t]) {
      const double y = shape.mesh->positions_m(vertex, 1);
      const bool hair = part_of(shape, vertex) == FacePart::hair;
      const double bare = hair ? 0.0 : (kCovered_m - y) / (kCovered_m - kBare_m);
      out[t] = std::min(out[t], static_cast<float>(std::clamp(bare, 0.0, 1.0)));
    }
  }
  return out;
}

std::array<int, 2> pupil_triangles(const MorphShape& shape, const SurfaceTopology& topology) {
  std::array<int, 2> best = {-1, -1};
  std::array<double, 2> depth = {0.0, 0.0};
  for (std::size_t t = 0; t < topology.triangles.size(); ++t) {
    const auto& corner = topology.triangles[t];
    const FacePart part = part_of(shape, corner[0]);
    if (part != FacePart::pupil && part != FacePart::iris) continue;
    const Eigen::RowVector3d centre =
        (shape.mesh->positions_m.row(corner[0]) + shape.mesh->positions_m.row(corner[1]) +
         shape.mesh->positions_m.row(corner[2])) /
        3.0;
    const std::size_t eye = centre.x() < 0.0 ? 0 : 1;
    if (best[eye] >= 0 && centre.z() <= depth[eye]) continue;
    best[eye] = static_cast<int>(t);
    depth[eye] = centre.z();
  }
  return best;
}

std::vector<float> contour_weight(const MorphShape& shape) {
  PointsF normals;
  vertex_normals(shape.mesh->positions_m.cast<float>(), shape.mesh->triangles, normals);
  std::vector<float> out(static_cast<std::size_t>(shape.mesh->vertex_count()), 0.0f);
  for (std::size_t v = 0; v < out.size(); ++v) {
    const FacePart part = part_of(shape, static_cast<int>(v));
    if (part != FacePart::skin && part != FacePart::lips && part != FacePart::brow) continue;
    out[v] = std::clamp((normals(static_cast<Eigen::Index>(v), 2) - 0.15f) / 0.2f, 0.0f, 1.0f);
  }
  return out;
}

ContourOptions contour_options(double eyes_px) {
  // A face's outline is rounder or hollower than the model's by about this much, alike along such
  // a length of it; turns between frames move it less far.
  constexpr double kSigma = 0.03, kCorrelation = 0.2, kReach = 0.25;
  constexpr double kLeastSigma_px = 0.5;
  return {kReach * eyes_px, std::max(kLeastSigma_px, kSigma * eyes_px), kCorrelation * eyes_px};
}

std::vector<float> triangle_weights(const MorphShape& shape, const SurfaceTopology& topology,
                                    float (*weight)(FacePart)) {
  std::vector<float> out;
  out.reserve(topology.triangles.size());
  for (const auto& corner : topology.triangles) {
    out.push_back(std::min({weight(part_of(shape, corner[0])), weight(part_of(shape, corner[1])),
                            weight(part_of(shape, corner[2]))}));
  }
  return out;
}

}  // namespace semblance
