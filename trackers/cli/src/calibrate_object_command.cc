// `semblance calibrate object`: a camera and poses from pictures of a known mesh.
#include <fmt/format.h>

#include <charconv>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "commands.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/core/progress.h"
#include "semblance/io/camera_formats.h"
#include "semblance/io/camera_io.h"
#include "semblance/io/camera_rig.h"
#include "semblance/io/image_io.h"
#include "semblance/io/marks_io.h"
#include "semblance/io/mesh_io.h"
#include "semblance/object/object_report.h"

namespace semblance::cli {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct ObjectCommandOptions {
  std::vector<std::string> files;
  std::string mesh, texture, pairs, masks, camera, lens = "pinhole", folder;
  double metres_per_unit = 1.0, pair_sigma_px = 4.0;
  bool principal = false, pairs_only = false;
};

/// A mesh file's vertices by their number in the file, which counts from 0.
class MeshVertices {
 public:
  MeshVertices(const std::string& path, double metres_per_unit) : path_(path) {
    if (fs::path(path).extension() == ".obj" || fs::path(path).extension() == ".OBJ") {
      MeshFile file = read_obj(path);
      mesh_ = std::move(file.mesh);
      for (std::size_t v = 0; v < file.file_vertex.size(); ++v) {
        vertex_.emplace(file.file_vertex[v], static_cast<Eigen::Index>(v));
      }
    } else {
      mesh_ = read_mesh(path);
      for (Eigen::Index v = 0; v < mesh_.vertex_count(); ++v) {
        vertex_.emplace(static_cast<int>(v), v);
      }
    }
    mesh_.positions_m *= metres_per_unit;
  }
  const Mesh& mesh() const { return mesh_; }

  /// The place of the vertex that "vertex:12" names; none for other names.
  std::optional<Eigen::Vector3d> named(const std::string& name) const {
    constexpr std::string_view prefix = "vertex:";
    if (!name.starts_with(prefix)) return std::nullopt;
    int number = -1;
    const char* end = name.data() + name.size();
    const auto read = std::from_chars(name.data() + prefix.size(), end, number);
    const auto found = vertex_.find(number);
    if (read.ec != std::errc{} || read.ptr != end || found == vertex_.end()) {
      throw InvalidInput(
          fmt::format("'{}': {} has no such vertex; its {} vertices count from 0, and one that no "
                      "face uses has "
                      "no place",
                      name, path_, vertex_.size()));
    }
    return mesh_.positions_m.row(found->second).transpose();
  }

 private:
  std::string path_;
  Mesh mesh_;
  std::map<int, Eigen::Index> vertex_;
};

std::vector<ObjectPair> pairs_of(const MarksFile::Photo& photo, const MarksFile& marks,
                                 const MeshVertices& vertices, const std::string& source) {
  std::vector<ObjectPair> out;
  for (const auto& [name, pixel_px] : photo.marks_px) {
    const auto point = marks.points_m.find(name);
    const auto vertex = vertices.named(name);
    if (point == marks.points_m.end() && !vertex) {
      throw InvalidInput(
          fmt::format("{}: the mark '{}' of {} has no place on the mesh: give it under \"points\" "
                      "in metres, or "
                      "name it vertex:N after the mesh's vertex N",
                      source, name, photo.file));
    }
    out.push_back({name, vertex ? *vertex : point->second, pixel_px});
  }
  return out;
}

/// The marks of a picture: by its path, or by its bare name where that is the only one.
const MarksFile::Photo& photo_of(const std::string& file, const MarksFile& marks,
                                 const std::string& source) {
  const MarksFile::Photo* same_name = nullptr;
  int count = 0;
  for (const MarksFile::Photo& photo : marks.photos) {
    std::error_code ignored;
    if (fs::equivalent(photo.file, file, ignored)) return photo;
    if (fs::path(photo.file).filename() != fs::path(file).filename()) continue;
    same_name = &photo;
    ++count;
  }
  if (count == 1) return *same_name;
  throw InvalidInput(fmt::format(
      "{}: {} {}", source, count == 0 ? "has no marks of" : "has several photos named like", file));
}

Image mask_of(const std::string& folder, const std::string& picture) {
  if (folder.empty()) return {};
  const fs::path path = fs::path(folder) / (fs::path(picture).stem().string() + ".png");
  if (!fs::exists(path)) {
    throw InvalidInput(
        fmt::format("{}: there is no mask of {}; masks are PNG files named after "
                    "their pictures, white where the object is",
                    path.string(), picture));
  }
  return read_image(path.string());
}

std::vector<ObjectPicture> read_pictures(const ObjectCommandOptions& options,
                                         const MeshVertices& vertices) {
  const MarksFile marks = read_marks(options.pairs);
  std::set<std::string> stems;
  std::vector<ObjectPicture> pictures;
  for (const std::string& file : options.files) {
    if (!stems.insert(fs::path(file).stem().string()).second) {
      throw InvalidInput(fmt::format(
          "two pictures are named '{}'; results are named after them, so give them other names",
          fs::path(file).stem().string()));
    }
    pictures.push_back(
        {.name = file,
         .linear = read_image(file),
         .mask = mask_of(options.masks, file),
         .pairs = pairs_of(photo_of(file, marks, options.pairs), marks, vertices, options.pairs)});
  }
  return pictures;
}

Camera known_camera(const std::string& file) {
  const auto cameras = read_cameras(file, recognise_camera_file(file)).rig.cameras;
  if (cameras.size() != 1) {
    throw InvalidInput(
        fmt::format("{}: holds {} cameras, one was expected; take one out with "
                    "`calibrate convert --camera NAME`",
                    file, cameras.size()));
  }
  return cameras.front();
}

std::vector<double> list(const Eigen::VectorXd& values) { return {values.begin(), values.end()}; }

Json json_of(const ObjectPose& pose) {
  const Eigen::Quaterniond& q = pose.camera_from_object.rotation;
  const Eigen::VectorXd sigma = pose.covariance.diagonal().cwiseSqrt();
  return {{"rotation", {q.w(), q.x(), q.y(), q.z()}},
          {"translation_m", list(pose.camera_from_object.translation_m)},
          {"rotation_sigma_rad", list(sigma.head(3))},
          {"translation_sigma_m", list(sigma.tail(3))}};
}

Json json_of(const ObjectEstimate& estimate) {
  Json json{{"rms_px", estimate.pairs_rms_px},
            {"focal_px", list(estimate.camera.focal_px)},
            {"principal_px", list(estimate.camera.principal_px)},
            {"intrinsics_sigma", list(estimate.intrinsics_sigma)},
            {"focal_sought", estimate.focal_free}};
  return json;
}

Json summary_of(const std::vector<ObjectPicture>& pictures, const ObjectCalibration& found) {
  const ObjectEstimate& best = found.best();
  Json json = json_of(best);
  json["lens"] = lens_name(best.camera.lens);
  json["views"] = pictures.size();
  int outliers = 0;
  double outline_px = 0.0;
  Json views = Json::array();
  for (std::size_t k = 0; k < pictures.size(); ++k) {
    Json view{{"file", pictures[k].name}, {"pairs", pictures[k].pairs.size()}};
    view.update(json_of(best.poses[k]));
    view["from_pairs"] = json_of(found.from_pairs.poses[k]);
    if (k < found.fits.size()) {
      const ObjectFit& fit = found.fits[k];
      outliers += fit.outlier_pairs;
      outline_px = std::max(outline_px, fit.outline_rms_px);
      view["outline_rms_px"] = fit.outline_rms_px;
      view["outline_share"] = fit.outline_share;
      if (fit.colour_rms > 0.0) {
        view["colour_rms"] = fit.colour_rms;
        view["colour_correlation"] = fit.colour_correlation;
      }
    }
    views.push_back(std::move(view));
  }
  json["outliers"] = outliers;
  if (found.refined) json["outline_rms_px"] = outline_px;
  json["from_pairs"] = json_of(found.from_pairs);
  json["pictures"] = std::move(views);
  json["solve_s"] = found.solve_s;
  json["warnings"] = found.notes;
  return json;
}

/// One camera per picture, in the mesh's frame.
CameraRig rig_of(const std::vector<ObjectPicture>& pictures, const ObjectEstimate& estimate) {
  CameraRig rig;
  for (std::size_t k = 0; k < pictures.size(); ++k) {
    Camera camera = estimate.camera;
    camera.name = fs::path(pictures[k].name).stem().string();
    camera.camera_from_world = estimate.poses[k].camera_from_object;
    rig.cameras.push_back(std::move(camera));
  }
  return rig;
}

void write_results(const ObjectCommandOptions& options, const ObjectTarget& target,
                   const std::vector<ObjectPicture>& pictures, const ObjectCalibration& found) {
  prepare_output_folder(options.folder);
  const fs::path folder(options.folder);
  write_camera((folder / "camera.json").string(), found.best().camera);
  write_rig((folder / "rig.json").string(), rig_of(pictures, found.best()));
  std::vector<Rgb8> overlays;
  for (std::size_t k = 0; k < pictures.size(); ++k) {
    overlays.push_back(object_overlays(target, pictures[k], found, k));
    const std::string stem = fs::path(pictures[k].name).stem().string();
    write_image((folder / ("overlay_" + stem + ".png")).string(), overlays.back());
  }
  write_object_report((folder / "report.html").string(), folder.filename().string(), pictures,
                      found, overlays);
}

void print(const std::vector<ObjectPicture>& pictures, const ObjectCalibration& found) {
  const ObjectEstimate& best = found.best();
  fmt::print("focal {:.2f} px{}, principal {:.2f} {:.2f} px; pairs {:.2f} px rms; {:.2f} s\n",
             best.camera.focal_px.x(),
             best.focal_free ? fmt::format(" ± {:.2f}", best.intrinsics_sigma[0]) : " (kept)",
             best.camera.principal_px.x(), best.camera.principal_px.y(), best.pairs_rms_px,
             found.solve_s);
  for (std::size_t k = 0; k < found.fits.size(); ++k) {
    const ObjectFit& fit = found.fits[k];
    fmt::print("{}: outline {:.2f} px rms, found along {:.0f} %{}\n", pictures[k].name,
               fit.outline_rms_px, 100.0 * fit.outline_share,
               fit.colour_rms > 0.0 ? fmt::format("; colours {:.3f} rms", fit.colour_rms) : "");
  }
  for (const std::string& note : found.notes) fmt::print("warning: {}\n", note);
}

void run_object(const Context& context, const ObjectCommandOptions& options) {
  const MeshVertices vertices(options.mesh, options.metres_per_unit);
  const Image texture = options.texture.empty() ? Image() : read_image(options.texture);
  const ObjectTarget target = make_object_target(vertices.mesh(), texture, options.mesh);
  const std::vector<ObjectPicture> pictures = read_pictures(options, vertices);
  ObjectOptions calibration;
  if (!options.camera.empty()) calibration.camera = known_camera(options.camera);
  calibration.lens = *lens_from_name(options.lens);
  calibration.principal = options.principal;
  calibration.pair_sigma_px = options.pair_sigma_px;
  calibration.refine = !options.pairs_only;
  calibration.cancelled = [] { return interrupted(); };
  const ObjectCalibration found = calibrate_object(target, pictures, calibration);
  write_results(options, target, pictures, found);
  print(pictures, found);
  write_summary(context, summary_of(pictures, found).dump(1));
  fmt::print("results in {}: camera.json rig.json report.html and an overlay per picture\n",
             options.folder);
}

}  // namespace

void add_calibrate_object_command(CLI::App& calibrate, Context& context) {
  CLI::App* object = calibrate.add_subcommand(
      "object", "A camera and poses from pictures of any object whose mesh is known");
  auto options = std::make_shared<ObjectCommandOptions>();
  object->add_option("pictures", options->files, "Pictures (PNG, JPEG) taken by one camera")
      ->required();
  object->add_option("--mesh", options->mesh, "The object's mesh (OBJ, PLY)")->required();
  object
      ->add_option("--pairs", options->pairs,
                   "Points of the mesh and their pixels (semblance.marks/1); a mark named vertex:N "
                   "is the mesh's vertex N")
      ->required();
  object->add_option("--metres-per-unit", options->metres_per_unit, "The mesh's unit of length")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  object->add_option("--texture", options->texture,
                     "The mesh's texture: its colours are compared too");
  object->add_option("--masks", options->masks,
                     "Folder of PNG files named after the pictures, white where the object is");
  CLI::Option* camera = object->add_option("--camera", options->camera,
                                           "A known camera: its focal length and lens are kept");
  std::vector<std::string> lenses;
  for (const Lens lens : all_lenses) lenses.emplace_back(lens_name(lens));
  object->add_option("--lens", options->lens, "Lens whose distortion is sought")
      ->check(CLI::IsMember(lenses))
      ->capture_default_str()
      ->excludes(camera);
  object
      ->add_flag("--principal", options->principal,
                 "Seek the principal point; otherwise it is the middle of the picture")
      ->excludes(camera);
  object
      ->add_option("--pair-sigma", options->pair_sigma_px,
                   "How far pairs are usually beside their places, in pixels")
      ->check(CLI::Range(0.01, 1000.0))
      ->capture_default_str();
  object->add_flag("--pairs-only", options->pairs_only, "Stop after the estimate from pairs");
  object->add_option("-o,--output", options->folder, "Folder for the results")->required();
  object->callback([&context, options] {
    context.action = [&context, options] { run_object(context, *options); };
  });
}

}  // namespace semblance::cli
