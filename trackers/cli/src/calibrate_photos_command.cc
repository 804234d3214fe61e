// `semblance calibrate photos`: one camera's photos of marks, or of anything by COLMAP.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "calibration_results.h"
#include "commands.h"
#include "semblance/cameras/colmap_program.h"
#include "semblance/cameras/photo_calibration.h"
#include "semblance/cameras/scene_frame.h"
#include "semblance/cameras/sheet_pictures.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/camera_io.h"
#include "semblance/io/image_io.h"

namespace semblance::cli {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct PhotosOptions {
  std::vector<std::string> photos;
  std::string marks, sheet, lens = "pinhole", method = "joint", folder;
  bool colmap = false, principal = false, keep_outliers = false;
};

// What either way of finding the cameras leads to.
struct Solved {
  std::vector<std::string> photos;       // of the placements
  std::vector<std::string> point_names;  // of the survey's points; empty for COLMAP's
  PhotoCalibration calibration;
  std::vector<std::string> notes;
};

PhotoOptions library_options(const PhotosOptions& options) {
  PhotoOptions result;
  result.lens = *lens_from_name(options.lens);
  result.principal = options.principal;
  result.keep_outliers = options.keep_outliers;
  result.cancelled = [] { return interrupted(); };
  return result;
}

int index_of(const std::vector<std::string>& names, const std::string& name) {
  return static_cast<int>(std::lower_bound(names.begin(), names.end(), name) - names.begin());
}

std::set<int> points_with_sightings(const Survey& survey) {
  std::set<int> points;
  for (const Sighting& sighting : survey.sightings) points.insert(sighting.point);
  return points;
}

// Both ways of the solve from the same start, for who wants to see them side by side.
void compare_ways(const Survey& start, const PhotoOptions& options, const PhotoCalibration& joint,
                  Json& summary) {
  const PhotoCalibration loop = calibrate_by_loop(start, options);
  const auto tell = [&](const char* name, const PhotoCalibration& way) {
    fmt::print("{}: {:.3f} px rms, {} {}, {:.3f} s{}\n", name, way.rms_px, way.rounds,
               way.adjustment ? "iterations" : "rounds", way.solve_s,
               way.converged ? "" : "; has not converged");
    summary["methods"].push_back({{"name", name},
                                  {"rms_px", way.rms_px},
                                  {"rounds", way.rounds},
                                  {"solve_s", way.solve_s},
                                  {"converged", way.converged},
                                  {"focal_px", way.survey.cameras[0].focal_px.x()}});
  };
  tell("loop", loop);
  tell("joint", joint);
}

Solved solve_by_marks(const PhotosOptions& options, const MarksFile& marks, Json& summary) {
  Solved solved;
  solved.point_names = marks.names();
  PhotoOptions library = library_options(options);
  for (const MarksFile::Length& length : marks.lengths) {
    library.lengths.push_back({index_of(solved.point_names, length.from),
                               index_of(solved.point_names, length.to), length.length_m,
                               length.sigma_m});
  }
  std::vector<Eigen::Vector3d> rough(
      solved.point_names.size(),
      Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
  for (const auto& [name, point] : marks.points_m) {
    rough[static_cast<std::size_t>(index_of(solved.point_names, name))] = point;
  }
  const Survey start = best_start_from_photos(photos_with_marks(marks), rough, library);
  const std::set<int> placed = points_with_sightings(start);
  for (std::size_t i = 0; i < solved.point_names.size(); ++i) {
    if (placed.count(static_cast<int>(i)) > 0) continue;
    solved.notes.push_back(
        fmt::format("mark '{}' has no place: no two photos show it from different sides",
                    solved.point_names[i]));
  }
  solved.calibration = calibrate_jointly(start, library);
  if (options.method == "both") compare_ways(start, library, solved.calibration, summary);
  for (const MarksFile::Photo& photo : marks.photos) solved.photos.push_back(photo.file);
  return solved;
}

Solved solve_by_colmap(const PhotosOptions& options, Progress& progress) {
  const std::map<std::string, std::string> models{{"pinhole", "SIMPLE_PINHOLE"},
                                                  {"brown2", "RADIAL"},
                                                  {"brown5", "OPENCV"},
                                                  {"fisheye", "OPENCV_FISHEYE"}};
  const auto model = models.find(options.lens);
  if (model == models.end()) {
    throw InvalidInput(
        fmt::format("COLMAP has no lens '{}' of one camera; choose pinhole, brown2, "
                    "brown5 or fisheye",
                    options.lens));
  }
  const fs::path workspace = fs::path(options.folder) / "colmap";
  make_folder(workspace.string());
  const ColmapModel found =
      reconstruct_with_colmap(options.photos, model->second, workspace.string(), progress);
  Solved solved;
  std::set<std::string> placed;
  for (const auto& [id, image] : found.images) {
    solved.photos.push_back(image.name);
    placed.insert(image.name);
  }
  for (const std::string& photo : options.photos) {
    if (placed.count(photo) == 0) solved.notes.push_back(photo + ": COLMAP found no place for it");
  }
  solved.calibration = calibrate_jointly(survey_from_colmap(found), library_options(options));
  return solved;
}

// Cameras named after their photos.
std::vector<std::string> names_of_photos(const std::vector<std::string>& photos) {
  std::vector<std::string> names;
  std::set<std::string> used;
  for (const std::string& photo : photos) {
    const std::string stem = fs::path(photo).stem().string();
    std::string name = stem;
    for (int i = 2; !used.insert(name).second; ++i) name = fmt::format("{}-{}", stem, i);
    names.push_back(std::move(name));
  }
  return names;
}

Scene scene_of(const Solved& solved, const std::optional<MarksFile>& marks) {
  Scene scene;
  const Survey& survey = solved.calibration.survey;
  scene.cameras = cameras_of_photos(survey, names_of_photos(solved.photos));
  if (!solved.point_names.empty()) {
    for (const int point : points_with_sightings(survey)) {
      const auto at = static_cast<std::size_t>(point);
      scene.points_m[solved.point_names[at]] = survey.points_m[at];
    }
  }
  if (!marks || !solved.point_names.empty()) return scene;
  std::vector<MarksFile::Photo> photos;
  for (const std::string& photo : solved.photos) {
    const auto same = [&](const MarksFile::Photo& p) {
      return fs::weakly_canonical(p.file) == fs::weakly_canonical(photo);
    };
    const auto found = std::find_if(marks->photos.begin(), marks->photos.end(), same);
    photos.push_back(found == marks->photos.end() ? MarksFile::Photo{photo, {}} : *found);
  }
  scene.points_m = place_marks(scene.cameras, photos);
  return scene;
}

SceneFrame frame_of(const Scene& scene, const Solved& solved, const std::optional<MarksFile>& marks,
                    const std::string& sheet, Progress& progress) {
  if (sheet.empty()) return marks ? frame_from_marks(scene, *marks) : SceneFrame{};
  return frame_from_sheet(scene,
                          find_sheet(solved.photos, parse_target(sheet), 0, progress).detections);
}

void note_frame(const SceneFrame& frame, std::vector<std::string>& notes) {
  if (!frame.has_scale) {
    notes.emplace_back(
        "nothing tells the scale: distances are in an arbitrary unit; give 'lengths' or three "
        "known "
        "'points' in the marks file, or --sheet");
  }
  if (!frame.has_axes) {
    notes.emplace_back("nothing tells the axes: the frame is that of the solve");
  }
}

CalibrationReport report_of(const PhotosOptions& options, const Solved& solved) {
  CalibrationReport report;
  report.title = fs::path(options.folder).filename().string();
  report.target = options.colmap ? "what the photos show, by COLMAP" : "marks in photos";
  for (const Sighting& sighting : solved.calibration.survey.sightings) {
    report.sighting_names.push_back(solved.photos[static_cast<std::size_t>(sighting.placement)]);
  }
  report.notes = solved.notes;
  return report;
}

void write_points(const std::string& path, const Scene& scene,
                  const std::optional<MarksFile>& marks) {
  MarksFile placed;
  if (marks) placed.photos = marks->photos;
  placed.points_m = scene.points_m;
  write_marks(path, placed);
}

void run_photos(const Context& context, const PhotosOptions& options) {
  const auto progress = console_progress();
  std::optional<MarksFile> marks;
  if (!options.marks.empty()) marks = read_marks(options.marks);
  prepare_output_folder(options.folder);
  Json summary{{"method", options.colmap ? "colmap" : options.method}, {"lens", options.lens}};
  const Solved solved = options.colmap ? solve_by_colmap(options, *progress)
                                       : solve_by_marks(options, *marks, summary);
  Scene scene = scene_of(solved, marks);
  const SceneFrame frame = frame_of(scene, solved, marks, options.sheet, *progress);
  move_scene(scene, frame.world_from_scene);

  const fs::path folder(options.folder);
  const Adjustment& adjustment = *solved.calibration.adjustment;
  write_camera((folder / "camera.json").string(), adjustment.survey.cameras[0]);
  write_rig((folder / "rig.json").string(), {scene.cameras});
  if (!scene.points_m.empty()) write_points((folder / "points.json").string(), scene, marks);
  CalibrationReport report = report_of(options, solved);
  note_frame(frame, report.notes);
  const Verdict verdict = finish_calibration(options.folder, adjustment, report, *progress);

  summary.update(json_of(adjustment, verdict, 0));
  summary["rms_all_px"] = adjustment.rms_all_px;
  summary["photos"] = solved.photos.size();
  summary["iterations"] = solved.calibration.rounds;
  summary["solve_s"] = solved.calibration.solve_s;
  if (!frame.text.empty()) {
    fmt::print("scale and axes: {}\n", frame.text);
    summary["frame"] = {{"by", frame.text}, {"rms_mm", 1e3 * frame.rms_m}};
  }
  add_warnings(verdict, report, summary);
  write_summary(context, summary.dump(1));
  fmt::print("results in {}: camera.json rig.json report.html{}\n", options.folder,
             scene.points_m.empty() ? "" : " points.json");
}

}  // namespace

void add_calibrate_photos_command(CLI::App& calibrate, Context& context) {
  CLI::App* photos = calibrate.add_subcommand(
      "photos", "One camera's photos, from anywhere, of marks or (--colmap) of anything");
  auto options = std::make_shared<PhotosOptions>();
  auto* files =
      photos->add_option("photos", options->photos, "(--colmap) Pictures, at least three");
  photos->add_option("--marks", options->marks,
                     "Marks in the photos, rough or known points, lengths and axes "
                     "(docs/formats/marks.md)");
  photos->add_flag("--colmap", options->colmap,
                   "Find the cameras by the program colmap; marks then give scale and axes");
  photos
      ->add_option("--sheet", options->sheet,
                   "A sheet in two photos or more gives scale and axes (as for `detect`)")
      ->check(sheet_name());
  photos->add_option("--lens", options->lens, "Lens of the camera")
      ->check(CLI::IsMember(lens_names()))
      ->capture_default_str();
  photos
      ->add_option("--method", options->method,
                   "joint: all at once; both: beside it the loop of cameras and points in turn, "
                   "for comparison")
      ->check(CLI::IsMember({"joint", "both"}))
      ->capture_default_str();
  photos->add_flag("--principal", options->principal,
                   "Seek the principal point; otherwise it is the middle of the picture");
  photos->add_flag("--keep-outliers", options->keep_outliers,
                   "Plain least squares: every mark counts");
  photos->add_option("-o,--output", options->folder, "Folder for the results")->required();
  photos->callback([&context, options, files] {
    if (options->colmap != (files->count() > 0)) {
      throw CLI::ValidationError("photos",
                                 "pictures and --colmap go together; photos with marks are named "
                                 "in the marks file");
    }
    if (!options->colmap && options->marks.empty()) {
      throw CLI::RequiredError("--marks (or pictures and --colmap)");
    }
    context.action = [&context, options] { run_photos(context, *options); };
  });
}

}  // namespace semblance::cli
