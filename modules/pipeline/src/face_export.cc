#include "semblance/pipeline/face_export.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "semblance/core/errors.h"
#include "semblance/io/gltf_writer.h"

namespace semblance {
namespace {

constexpr Eigen::Index k_pose_size = 7;  // unit quaternion and translation

bool is_straight(const MorphShape& shape, int parameter) {
  return std::none_of(shape.fields.begin(), shape.fields.end(), [&](const MorphField& field) {
    return field.parameter == parameter && field.weight;
  });
}

double field_weight(const MorphField& field, double value) {
  return field.weight ? field.weight(value).value : value;
}

/// Displacement of every vertex when one parameter leaves zero.
PointsF displacement_at(const MorphShape& shape, int parameter, double value) {
  PointsF out = PointsF::Zero(shape.mesh->vertex_count(), 3);
  for (const MorphField& field : shape.fields) {
    if (field.parameter != parameter) continue;
    const auto weight = static_cast<float>(field_weight(field, value) - field_weight(field, 0.0));
    out(field.vertices, Eigen::all) += weight * field.displacement_m;
  }
  return out;
}

/// A morph target that stands for one parameter on one side of zero.
class Blend {
 public:
  Blend(const MorphShape& shape, int parameter, double at)
      : parameter_(parameter), at_(at), straight_(is_straight(shape, parameter)) {
    const PointsF shift = displacement_at(shape, parameter, at);
    const double square = shift.cast<double>().squaredNorm();
    for (const MorphField& field : shape.fields) {
      if (field.parameter != parameter) continue;
      const PointsF there = shift(field.vertices, Eigen::all);
      const double product =
          there.cast<double>().cwiseProduct(field.displacement_m.cast<double>()).sum();
      shares_.emplace_back(&field, square > 0.0 ? product / square : 0.0);
    }
    target_.name = shape.parameters[static_cast<std::size_t>(parameter)].name;
    if (at < 0.0) target_.name += "_negative";
    for (int v = 0; v < shift.rows(); ++v)
      if (!shift.row(v).isZero(0.0f)) target_.vertices.push_back(v);
    target_.displacement_m = shift(target_.vertices, Eigen::all);
  }

  int parameter() const { return parameter_; }
  const GltfMorphTarget& target() const { return target_; }

  /// The weight that brings the target nearest, in the sum of squares over vertices.
  double weight(double value) const {
    if (!straight_ && (value < 0.0) != (at_ < 0.0)) return 0.0;
    double sum = 0.0;
    for (const auto& [field, share] : shares_)
      sum += share * (field_weight(*field, value) - field_weight(*field, 0.0));
    return sum;
  }

  /// Adds what the target does at `value`.
  void add_to(PointsF& displacement_m, double value) const {
    displacement_m(target_.vertices, Eigen::all) +=
        static_cast<float>(weight(value)) * target_.displacement_m;
  }

 private:
  int parameter_;
  double at_;
  bool straight_;
  std::vector<std::pair<const MorphField*, double>> shares_;
  GltfMorphTarget target_;
};

std::vector<Blend> blends_of(const MorphShape& shape, int parameter) {
  const ParameterBlock& block = shape.parameters[static_cast<std::size_t>(parameter)];
  std::vector<Blend> blends;
  if (is_straight(shape, parameter)) {
    blends.emplace_back(shape, parameter, 1.0);
    return blends;
  }
  if (block.upper[0] > 0.0) blends.emplace_back(shape, parameter, std::min(1.0, block.upper[0]));
  if (block.lower[0] < 0.0) blends.emplace_back(shape, parameter, std::max(-1.0, block.lower[0]));
  return blends;
}

const TrackFrame& last_estimate(const Track& track, const std::string& path) {
  const auto found =
      std::find_if(track.frames.rbegin(), track.frames.rend(),
                   [](const TrackFrame& frame) { return frame.status != TrackStatus::lost; });
  if (found == track.frames.rend())
    throw InvalidInput(path + ": every frame of the track is lost, so there is no face to write");
  return *found;
}

void check(const Track& track, const MorphShape& shape, const std::string& path) {
  const Eigen::Index expected = k_pose_size + static_cast<Eigen::Index>(shape.parameters.size());
  for (const TrackFrame& frame : track.frames)
    if (frame.status != TrackStatus::lost && frame.x.size() != expected)
      throw InvalidInput(fmt::format(
          "{}: frame {} of the track has {} parameters where the model has {}; use the model that "
          "was tracked",
          path, frame.frame, frame.x.size(), expected));
}

GltfKey key_of(const TrackFrame& frame, const std::vector<Blend>& blends, int identity_count) {
  GltfKey key;
  key.time_s = frame.time_s;
  key.world_from_model.rotation =
      Eigen::Quaterniond(frame.x[0], frame.x[1], frame.x[2], frame.x[3]).normalized();
  key.world_from_model.translation_m = frame.x.segment<3>(4);
  for (const Blend& blend : blends)
    key.weights.push_back(static_cast<float>(
        blend.weight(frame.x[k_pose_size + identity_count + blend.parameter()])));
  return key;
}

std::vector<GltfKey> animation_of(const Track& track, const std::vector<Blend>& blends,
                                  int identity_count) {
  std::vector<GltfKey> keys;
  const TrackFrame* lost = nullptr;  // the latest, since the last estimate
  for (const TrackFrame& frame : track.frames) {
    if (frame.status == TrackStatus::lost) {
      lost = &frame;
      continue;
    }
    if (lost != nullptr && !keys.empty()) {
      GltfKey held = keys.back();
      held.time_s = lost->time_s;
      keys.push_back(std::move(held));
    }
    lost = nullptr;
    keys.push_back(key_of(frame, blends, identity_count));
  }
  return keys;
}

}  // namespace

void write_face_glb(const std::string& path, const MorphShape& shape, const Image& texture,
                    const Track& track) {
  check(track, shape, path);
  const TrackFrame& last = last_estimate(track, path);
  const MorphShape person = with_identity(shape, last.x.segment(k_pose_size, shape.identity_count));
  const auto expression_count = static_cast<Eigen::Index>(person.parameters.size());
  const PointsF base_m = shape_positions(person, Eigen::VectorXd::Zero(expression_count));

  std::vector<Blend> blends;
  for (int p = 0; p < expression_count; ++p)
    for (Blend& blend : blends_of(person, p)) blends.push_back(std::move(blend));

  GltfScene scene;
  scene.mesh = *person.mesh;
  scene.mesh.positions_m = base_m.cast<double>();
  if (!texture.empty()) scene.texture = rgb8_from_linear(texture);
  for (const Blend& blend : blends) scene.targets.push_back(blend.target());
  scene.animation = animation_of(track, blends, shape.identity_count);
  write_glb(path, scene);
}

double blend_deviation_m(const MorphShape& shape, int parameter) {
  constexpr int k_samples = 41;
  const ParameterBlock& block = shape.parameters.at(static_cast<std::size_t>(parameter));
  const std::vector<Blend> blends = blends_of(shape, parameter);
  double largest = 0.0;
  for (int i = 0; i < k_samples; ++i) {
    const double value = block.lower[0] + (block.upper[0] - block.lower[0]) * i / (k_samples - 1.0);
    PointsF difference = -displacement_at(shape, parameter, value);
    for (const Blend& blend : blends) blend.add_to(difference, value);
    largest = std::max(largest, static_cast<double>(difference.rowwise().norm().maxCoeff()));
  }
  return largest;
}

}  // namespace semblance
