#include "mouth_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "semblance/core/atomic_file.h"
#include "semblance/io/gltf_writer.h"

namespace semblance {
namespace {

std::string point_list(const MouthPoints& points_px) {
  std::string text = "[";
  for (Eigen::Index i = 0; i < points_px.rows(); ++i) {
    text += fmt::format("{}[{:.4f},{:.4f},{:.4f}]", i > 0 ? "," : "", points_px(i, 0),
                        points_px(i, 1), points_px(i, 2));
  }
  return text + "]";
}

constexpr std::size_t most_shapes = 500;

/// At most `most_shapes` of the times, first and last included.
std::vector<double> shape_times(const std::vector<double>& times_s) {
  if (times_s.size() <= most_shapes) return times_s;
  std::vector<double> chosen;
  for (std::size_t k = 0; k < most_shapes; ++k) {
    chosen.push_back(times_s[k * (times_s.size() - 1) / (most_shapes - 1)]);
  }
  return chosen;
}

nlohmann::ordered_json header(const MouthWireframe& wireframe, const std::vector<MouthKey>& keys) {
  nlohmann::ordered_json json{{"schema", "semblance.mouth_wireframe/1"},
                              {"contours", MouthWireframe::contour_count},
                              {"points_per_contour", wireframe.ring_size()},
                              {"proportions", wireframe.proportions()}};
  for (const auto& row : wireframe.triangles().rowwise()) {
    json["triangles"].push_back({row[0], row[1], row[2]});
  }
  for (const MouthKey& key : keys) {
    json["keys"].push_back({{"frame", key.frame}, {"time_s", key.time_s}, {"viseme", key.viseme}});
  }
  return json;
}

}  // namespace

LipTrack animated_track(const LipTrack& source, const std::vector<int>& key_rows,
                        const MouthMotion& motion, const std::vector<double>& times_s) {
  LipTrack track;
  track.marker_count = motion.marker_count();
  MouthPoints position, velocity;
  for (std::size_t k = 0; k < times_s.size(); ++k) {
    motion.at(times_s[k], position, &velocity);
    const int segment = motion.segment_at(times_s[k]);
    const LipFrame &before = source.frames[key_rows[segment]],
                   &after = source.frames[key_rows[segment + 1]];
    const LipFrame* key = times_s[k] == before.time_s  ? &before
                          : times_s[k] == after.time_s ? &after
                                                       : nullptr;
    LipFrame frame{
        static_cast<int>(k), times_s[k], std::min(before.confidence, after.confidence), {}};
    for (int i = 0; i < track.marker_count; ++i) {
      const MarkerState state = key != nullptr ? key->markers[i].state : MarkerState::bridged;
      frame.markers.push_back({state, position.row(i).head<2>(), velocity.row(i).head<2>()});
    }
    track.frames.push_back(std::move(frame));
  }
  return track;
}

void write_wireframe_json(const std::string& path, const MouthWireframe& wireframe,
                          const MouthMotion& motion, const std::vector<MouthKey>& keys,
                          const std::vector<double>& times_s) {
  AtomicFile file(path);
  // The frames are many: they are written one by one, a line each, and not held as JSON.
  std::string opening = header(wireframe, keys).dump();
  opening.pop_back();
  file.stream() << opening << ",\n\"frames\":[";
  MouthPoints markers, points;
  for (std::size_t k = 0; k < times_s.size(); ++k) {
    motion.at(times_s[k], markers);
    wireframe.evaluate(markers, points);
    file.stream() << (k > 0 ? ",\n" : "\n")
                  << fmt::format("{{\"time_s\":{},\"points_px\":{}}}", times_s[k],
                                 point_list(points));
  }
  file.stream() << "\n]}\n";
  file.commit();
}

void write_mouth_glb(const std::string& path, const MouthWireframe& wireframe,
                     const MouthMotion& motion, const std::vector<double>& times_s,
                     const PictureSpace& space, const std::optional<Rgb8>& texture) {
  MouthPoints markers, points;
  const auto pose = [&](double time_s) {
    motion.at(time_s, markers);
    wireframe.evaluate(markers, points);
    return space.world_m(points);
  };
  const PointsF first = pose(times_s.front());
  GltfScene scene;
  scene.name = "mouth";
  scene.mesh.positions_m = (first.rowwise() - first.colwise().mean()).cast<double>();
  scene.mesh.triangles = wireframe.triangles();
  scene.mesh.uvs = picture_uvs(points, space.camera().width, space.camera().height);
  scene.texture = texture;
  const std::vector<double> shapes_s = shape_times(times_s);
  for (std::size_t k = 0; k < shapes_s.size(); ++k) {
    GltfMorphTarget target{fmt::format("{:.3f} s", shapes_s[k]), {}, pose(shapes_s[k]) - first};
    for (int i = 0; i < wireframe.point_count(); ++i) target.vertices.push_back(i);
    scene.targets.push_back(std::move(target));
    GltfKey key{shapes_s[k] - shapes_s.front(), {}, std::vector<float>(shapes_s.size(), 0.0f)};
    key.weights[k] = 1.0f;
    scene.animation.push_back(std::move(key));
  }
  write_glb(path, scene);
}

}  // namespace semblance
