#include "simulate_outputs.h"

#include <fmt/format.h>

#include <numbers>

#include "drape_picture.h"
#include "semblance/cloth/checkpoint.h"
#include "semblance/core/atomic_file.h"
#include "semblance/io/gltf_writer.h"
#include "semblance/io/image_io.h"
#include "semblance/io/mesh_io.h"

namespace semblance::cli {
namespace {

namespace fs = std::filesystem;

/// With (u, v) in metres: the file can be the sheet of a scene, and be compared with another run.
Mesh material_mesh(const Sheet& sheet, const Points& positions_m) {
  Mesh mesh;
  mesh.positions_m = positions_m;
  mesh.triangles = sheet.triangles;
  mesh.uvs = sheet.material_m.cast<float>();
  return mesh;
}

void remove_matching(const fs::path& folder, const std::string& start) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().filename().string().starts_with(start)) fs::remove(entry.path(), error);
  }
}

template <class Body>
void write_table(const std::string& path, const std::string& header, const Body& body) {
  AtomicFile file(path);
  file.stream() << header << '\n';
  body(file.stream());
  file.commit();
}

/// Displacements from the first frame, one target per frame.
GltfMorphTarget target(const std::string& name, const Points& from, const Points& to) {
  GltfMorphTarget out;
  out.name = name;
  const PointsF moved = (to - from).cast<float>();
  for (int v = 0; v < moved.rows(); ++v) {
    if (!moved.row(v).isZero(0.0f)) out.vertices.push_back(v);
  }
  out.displacement_m = moved(out.vertices, Eigen::all);
  return out;
}

}  // namespace

SimulationFiles::SimulationFiles(std::string folder, std::string format, bool resume)
    : folder_(std::move(folder)), format_(std::move(format)), resume_(resume) {}

void SimulationFiles::begin() {
  prepare_output_folder(folder_);
  if (resume_) return;
  for (const char* name : {"rest.obj", "rest.bin", "energy.csv", "strain.csv", "profile.csv",
                           "compression.png", "drape.png", "motion.glb", "checkpoint.bin"}) {
    std::error_code error;
    fs::remove(folder_ / name, error);
  }
  remove_matching(folder_, "level-");
  remove_matching(folder_ / "frames", "frame-");
  std::error_code error;
  fs::remove(folder_ / "frames", error);  // if that has left it empty
}

/// Frames of a .glb wait as meshes until all are there.
std::string SimulationFiles::frame_path(int number) const {
  return (folder_ / "frames" /
          fmt::format("frame-{:05}.{}", number, format_ == "obj" ? "obj" : "ply"))
      .string();
}

void SimulationFiles::frame(int number, double, const Sheet& sheet, const Points& positions_m) {
  if (format_ == "none") return;
  prepare_output_folder(folder_ / "frames");
  write_mesh(frame_path(number), material_mesh(sheet, positions_m));
}

void SimulationFiles::write_shape(const std::string& name, const Sheet& sheet,
                                  const Points& positions_m) const {
  write_obj(path(name), material_mesh(sheet, positions_m));
}

void SimulationFiles::level_done(int number, const SimulationLevel&, const Sheet& sheet,
                                 const Points& positions_m) {
  write_shape(fmt::format("level-{}.obj", number + 1), sheet, positions_m);
}

void SimulationFiles::checkpoint(const SimulationCheckpoint& checkpoint) {
  write_checkpoint(checkpoint_path(), checkpoint);
}

void SimulationFiles::warn(const std::string& message) {
  fmt::print(stderr, "semblance: warning: {}\n", message);
}

void SimulationFiles::finish(const SimulationSummary& summary, double frames_per_second) {
  write_log(summary);
  if (summary.stopped) return;
  const Points& positions_m = summary.state.positions_m;
  write_strain(summary);
  write_image(path("drape.png"), draw_drape(summary.scene, positions_m, summary.state.time_s));
  if (summary.drape) write_profile(*summary.drape);
  if (format_ == "glb" && summary.frames > 0) write_animation(summary, frames_per_second);
  write_shape("rest.obj", summary.scene.sheet, positions_m);
  write_state(summary);
  std::error_code error;
  fs::remove(checkpoint_path(), error);
}

void SimulationFiles::write_log(const SimulationSummary& summary) const {
  write_table(
      path("energy.csv"),
      "level,time_s,step_s,kinetic_j,elastic_j,gravity_j,contact_j,relative_residual,speed_m_s,"
      "largest_elongation,newton_iterations,linear_iterations,contacts",
      [&](std::ostream& out) {
        for (const SimulationRow& row : summary.rows) {
          out << fmt::format(
              "{},{:.9g},{:.6g},{:.9g},{:.9g},{:.9g},{:.9g},{},{:.6g},{:.6g},"
              "{},{},{}\n",
              row.level + 1, row.time_s, row.step_s, row.kinetic_j, row.elastic_j, row.gravity_j,
              row.contact_j, row.residual ? fmt::format("{:.6g}", *row.residual) : "",
              row.speed_m_s, row.elongation, row.newton_iterations, row.linear_iterations,
              row.contacts);
        }
      });
}

/// What a later run needs beside the shape to start from it as if this one had gone on.
void SimulationFiles::write_state(const SimulationSummary& summary) const {
  SimulationCheckpoint end;
  end.state.positions_m = summary.state.positions_m;
  end.state.friction = summary.state.friction;
  end.barrier_factor = summary.barrier_factor;
  write_checkpoint(path("rest.bin"), end);
}

void SimulationFiles::write_strain(const SimulationSummary& summary) const {
  const ClothScene& scene = summary.scene;
  std::vector<bool> fixed(scene.fixed.empty() ? 0 : scene.sheet.vertex_count(), false);
  for (const int v : scene.fixed) fixed[v] = true;
  const Deformation deformation = deformation_of(scene.sheet, scene.model.bending, fixed);
  std::vector<double> elongations(deformation.last(StrainKind::weft));
  for (int e = 0; e < deformation.last(StrainKind::weft); ++e) {
    elongations[e] = deformation.strain(summary.state.positions_m, e).norm() - 1.0;
  }
  write_table(path("strain.csv"), "direction,vertex_1,vertex_2,vertex_3,elongation",
              [&](std::ostream& out) {
                for (int e = 0; e < deformation.last(StrainKind::weft); ++e) {
                  const auto row = deformation.row(e);
                  out << (e < deformation.last(StrainKind::warp) ? "warp" : "weft");
                  for (int k = 0; k < 3; ++k) {
                    out << ',';
                    if (k < static_cast<int>(row.size())) out << row[k].vertex + 1;
                  }
                  out << fmt::format(",{:.9g}\n", elongations[e]);
                }
              });
  write_image(path("compression.png"), draw_compression(scene.sheet, deformation, elongations));
}

void SimulationFiles::write_profile(const DrapeProfile& profile) const {
  write_table(path("profile.csv"), "angle_deg,radius_m", [&](std::ostream& out) {
    for (std::size_t k = 0; k < profile.radii_m.size(); ++k) {
      out << fmt::format(
          "{:g},{:.9g}\n",
          360.0 * static_cast<double>(k) / static_cast<double>(profile.radii_m.size()),
          profile.radii_m[k]);
    }
  });
}

void SimulationFiles::write_animation(const SimulationSummary& summary,
                                      double frames_per_second) const {
  GltfScene scene;
  scene.name = "cloth";
  scene.mesh = read_ply(frame_path(0));
  const int frames = summary.frames;
  for (int k = 0; k < frames; ++k) {
    if (k > 0) {
      scene.targets.push_back(target(fmt::format("frame {}", k), scene.mesh.positions_m,
                                     read_ply(frame_path(k)).positions_m));
    }
    GltfKey key;
    key.time_s = k / frames_per_second;
    key.weights.assign(frames - 1, 0.0f);
    if (k > 0) key.weights[k - 1] = 1.0f;
    scene.animation.push_back(std::move(key));
  }
  write_glb(path("motion.glb"), scene);
  remove_matching(folder_ / "frames", "frame-");
  std::error_code error;
  fs::remove(folder_ / "frames", error);
}

nlohmann::json simulation_json(const SimulationSummary& summary, const std::string& method,
                               double spacing_m) {
  double cpu_s = 0.0, wall_s = 0.0, contact_s = 0.0;
  std::int64_t steps = 0, newton = 0, linear = 0;
  nlohmann::json levels = nlohmann::json::array();
  for (const SimulationLevel& level : summary.levels) {
    cpu_s += level.cpu_s, wall_s += level.wall_s, contact_s += level.contact_s;
    steps += level.steps, newton += level.newton_iterations, linear += level.linear_iterations;
    levels.push_back({{"spacing_m", level.spacing_m},
                      {"vertices", level.vertices},
                      {"start", level.start},
                      {"steps", level.steps},
                      {"newton_iterations", level.newton_iterations},
                      {"linear_iterations", level.linear_iterations},
                      {"relative_residual", level.residual},
                      {"at_rest", level.at_rest},
                      {"cpu_s", level.cpu_s},
                      {"wall_s", level.wall_s}});
  }
  nlohmann::json out = {{"method", method},
                        {"spacing_m", spacing_m},
                        {"fabric", summary.scene.fabric.name},
                        {"assumptions", summary.scene.fabric.assumptions},
                        {"vertices", summary.scene.sheet.vertex_count()},
                        {"at_rest", summary.at_rest},
                        {"stopped", summary.stopped},
                        {"cpu_s", cpu_s},
                        {"wall_s", wall_s},
                        {"steps", steps},
                        {"rejected_steps", summary.rejected_steps},
                        {"newton_iterations", newton},
                        {"linear_iterations", linear},
                        {"collision_share", wall_s > 0.0 ? contact_s / wall_s : 0.0},
                        {"residual_n", summary.residual_n},
                        {"relative_residual", summary.residual},
                        {"max_edge_strain", summary.largest_elongation},
                        {"max_edge_compression", summary.largest_compression},
                        {"penetrations", summary.penetrations},
                        {"drape_coefficient", nullptr},
                        {"drape_coefficient_deviation", nullptr},
                        {"simulated_s", nullptr},
                        {"frames", summary.frames},
                        {"levels", levels}};
  if (method == "dynamic") {
    out["simulated_s"] = summary.state.time_s;
    out["shortest_step_s"] = summary.shortest_step_s;
    out["barrier_factor"] = summary.barrier_factor;
  }
  if (summary.over_strained_s) out["strain_limit_passed_s"] = *summary.over_strained_s;
  return out;
}

}  // namespace semblance::cli
