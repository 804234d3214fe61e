// `semblance calibrate photos`: one camera's photos of marks, or of anything by COLMAP; or the
// places of cameras whose lenses are known.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <set>

#include "calibration_results.h"
#include "commands.h"
#include "drawn_photos.h"
#include "semblance/cameras/colmap_program.h"
#include "semblance/cameras/photo_calibration.h"
#include "semblance/cameras/scene_frame.h"
#include "semblance/cameras/sheet_pictures.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/camera_io.h"
#include "semblance/io/image_io.h"
#include "semblance/io/picture_size.h"
#include "sheet_command.h"

namespace semblance::cli {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct PhotosOptions {
  std::vector<std::string> photos, cameras;
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

// The marks as the library takes them.
struct MarkedPhotos {
  std::vector<std::string> names;  // of the points
  std::vector<PhotoMarks> photos;
  std::vector<Eigen::Vector3d> rough_points_m;  // NaN where nothing is known
  PhotoOptions options;
};

// Three known points that photos show make a frame; less of them do not.
void require_frame(const MarkedPhotos& marked) {
  constexpr int fewest = 3;
  int shown = 0;
  for (const KnownPoint& known : marked.options.known_points) {
    shown += std::any_of(marked.photos.begin(), marked.photos.end(), [&](const PhotoMarks& photo) {
      return std::count(photo.points.begin(), photo.points.end(), known.point) > 0;
    });
  }
  if (shown >= fewest) return;
  throw InvalidInput(
      fmt::format("points_sigma_m: the photos show {} of the known points; {} make a frame. Leave "
                  "it out if the points are rough",
                  shown, fewest));
}

MarkedPhotos marked_photos(const PhotosOptions& options, const MarksFile& marks) {
  MarkedPhotos marked;
  marked.names = marks.names();
  marked.photos = photos_with_marks(marks);
  marked.options = library_options(options);
  for (const MarksFile::Length& length : marks.lengths) {
    marked.options.lengths.push_back({index_of(marked.names, length.from),
                                      index_of(marked.names, length.to), length.length_m,
                                      length.sigma_m});
  }
  marked.rough_points_m.assign(marked.names.size(),
                               Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
  for (const auto& [name, point] : marks.points_m) {
    const int index = index_of(marked.names, name);
    marked.rough_points_m[static_cast<std::size_t>(index)] = point;
    if (!marks.points_sigma_m) continue;
    marked.options.known_points.push_back({index, point, *marks.points_sigma_m});
  }
  if (marks.points_sigma_m) require_frame(marked);
  return marked;
}

// The stored camera of each photo.
std::vector<Camera> lenses_of_photos(const PhotosOptions& options, const MarksFile& marks,
                                     std::vector<std::string>& notes) {
  const std::vector<Camera> stored = given_cameras(options.cameras);
  std::vector<Camera> cameras;
  for (const MarksFile::Photo& photo : marks.photos) {
    const std::string name =
        photo.camera.empty() ? fs::path(photo.file).stem().string() : photo.camera;
    auto found = std::find_if(stored.begin(), stored.end(),
                              [&](const Camera& camera) { return camera.name == name; });
    if (found == stored.end() && stored.size() == 1) found = stored.begin();
    if (found == stored.end()) {
      throw InvalidInput(fmt::format(
          "{}: no stored camera is named '{}'; name it by \"camera\" beside the photo's \"file\"",
          photo.file, name));
    }
    cameras.push_back(camera_for_pictures(*found, read_image_rgb8(photo.file), photo.file, notes));
    cameras.back().name = name;
  }
  return cameras;
}

void finish_marks(const MarksFile& marks, Solved& solved) {
  const std::set<int> placed = points_with_sightings(solved.calibration.survey);
  for (std::size_t i = 0; i < solved.point_names.size(); ++i) {
    if (placed.count(static_cast<int>(i)) > 0) continue;
    solved.notes.push_back(
        fmt::format("mark '{}' has no place: no two photos show it from different sides",
                    solved.point_names[i]));
  }
  for (const MarksFile::Photo& photo : marks.photos) solved.photos.push_back(photo.file);
}

Solved solve_by_marks(const PhotosOptions& options, const MarksFile& marks, Json& summary) {
  const MarkedPhotos marked = marked_photos(options, marks);
  Solved solved;
  solved.point_names = marked.names;
  const Survey start = best_start_from_photos(marked.photos, marked.rough_points_m, marked.options);
  solved.calibration = calibrate_jointly(start, marked.options);
  if (options.method == "both") compare_ways(start, marked.options, solved.calibration, summary);
  finish_marks(marks, solved);
  return solved;
}

Solved solve_with_lenses(const PhotosOptions& options, const MarksFile& marks) {
  const MarkedPhotos marked = marked_photos(options, marks);
  Solved solved;
  solved.point_names = marked.names;
  const std::vector<Camera> lenses = lenses_of_photos(options, marks, solved.notes);
  solved.calibration =
      calibrate_with_lenses(lenses, marked.photos, marked.rough_points_m, marked.options);
  finish_marks(marks, solved);
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
  scene.cameras = survey.cameras.size() > 1
                      ? survey.cameras
                      : cameras_of_photos(survey, names_of_photos(solved.photos));
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

SceneFrame frame_of(const Scene& scene, const Solved& solved, std::optional<MarksFile> marks,
                    const PhotosOptions& options, Progress& progress) {
  if (!options.sheet.empty()) {
    const Target target = parse_target(options.sheet);
    return frame_from_sheet(scene, find_sheet(solved.photos, target, 0, progress).detections);
  }
  if (!marks) return {};
  if (options.colmap) marks->points_sigma_m.reset();  // its solve knew nothing of the points
  return frame_from_marks(scene, *marks);
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

// What each photo's marks came to. Outliers are named.
void add_marks(const Solved& solved, CalibrationReport& report) {
  const Survey& survey = solved.calibration.survey;
  std::map<std::string, std::vector<DrawnMark>> by_photo;
  for (std::size_t i = 0; i < survey.sightings.size(); ++i) {
    const Sighting& sighting = survey.sightings[i];
    const std::string& photo = report.sighting_names[i];
    const std::string& name = solved.point_names[static_cast<std::size_t>(sighting.point)];
    const Eigen::Vector2d error_px = residual_px(survey, sighting);
    const bool outlier = solved.calibration.adjustment->outlier[i] != 0;
    by_photo[photo].push_back({name, sighting.pixel_px, sighting.pixel_px + error_px, outlier});
    if (!outlier) continue;
    report.notes.push_back(fmt::format("{}: mark '{}' does not fit the others, {:.1f} px off",
                                       fs::path(photo).filename().string(), name, error_px.norm()));
  }
  for (const std::string& photo : solved.photos) {
    const auto marks = by_photo.find(photo);
    if (marks != by_photo.end()) report.pictures.push_back(draw_marks(photo, marks->second));
  }
}

CalibrationReport report_of(const PhotosOptions& options, const Solved& solved) {
  CalibrationReport report;
  report.title = fs::path(options.folder).filename().string();
  report.target = options.colmap ? "what the photos show, by COLMAP" : "marks in photos";
  for (const Sighting& sighting : solved.calibration.survey.sightings) {
    const int photo = options.cameras.empty() ? sighting.placement : sighting.camera;
    report.sighting_names.push_back(solved.photos[static_cast<std::size_t>(photo)]);
  }
  report.notes = solved.notes;
  if (!solved.point_names.empty()) add_marks(solved, report);
  return report;
}

void write_points(const std::string& path, const Scene& scene,
                  const std::optional<MarksFile>& marks) {
  MarksFile placed;
  if (marks) placed.photos = marks->photos;
  placed.points_m = scene.points_m;
  write_marks(path, placed);
}

// Of cameras with known lenses: where each one is.
Json json_of_places(const Adjustment& adjustment, const Verdict& verdict) {
  Json list = Json::array();
  for (std::size_t i = 0; i < adjustment.survey.cameras.size(); ++i) {
    const Camera& camera = adjustment.survey.cameras[i];
    Json json = json_of(adjustment, verdict, i);
    const Eigen::Vector3d at = camera.camera_from_world.inverse().translation_m;
    json["centre_m"] = {at.x(), at.y(), at.z()};
    fmt::print("{}: at {:.3f} {:.3f} {:.3f} m", camera.name, at.x(), at.y(), at.z());
    if (adjustment.covariance) {
      const CameraUncertainty& known = adjustment.covariance->cameras[i];
      const Eigen::Vector3d sigma = centre_covariance(camera, known).diagonal().cwiseSqrt();
      const double turn = std::sqrt(known.pose.topLeftCorner<3, 3>().trace());
      json["centre_sigma_m"] = {sigma.x(), sigma.y(), sigma.z()};
      json["turn_sigma_rad"] = turn;
      fmt::print(", deviations {:.1f} {:.1f} {:.1f} mm, direction {:.2f} degrees", 1e3 * sigma.x(),
                 1e3 * sigma.y(), 1e3 * sigma.z(), turn * 180.0 / std::numbers::pi);
    }
    fmt::print("\n");
    list.push_back(std::move(json));
  }
  return list;
}

void run_photos(const Context& context, const PhotosOptions& options) {
  const auto progress = console_progress();
  std::optional<MarksFile> marks;
  if (!options.marks.empty()) marks = read_marks(options.marks);
  prepare_output_folder(options.folder);
  const bool one_camera = options.cameras.empty();
  Json summary{{"method", options.colmap ? "colmap" : options.method}};
  if (one_camera) summary["lens"] = options.lens;
  const Solved solved = options.colmap ? solve_by_colmap(options, *progress)
                        : one_camera   ? solve_by_marks(options, *marks, summary)
                                       : solve_with_lenses(options, *marks);
  Scene scene = scene_of(solved, marks);
  const SceneFrame frame = frame_of(scene, solved, marks, options, *progress);
  move_scene(scene, frame.world_from_scene);

  const fs::path folder(options.folder);
  const Adjustment& adjustment = *solved.calibration.adjustment;
  if (one_camera) write_camera((folder / "camera.json").string(), adjustment.survey.cameras[0]);
  write_rig((folder / "rig.json").string(), {scene.cameras});
  if (!scene.points_m.empty()) write_points((folder / "points.json").string(), scene, marks);
  CalibrationReport report = report_of(options, solved);
  note_frame(frame, report.notes);
  if (!one_camera && !marks->points_sigma_m) {
    report.notes.push_back(
        fmt::format("places and deviations in the report are in the frame of '{}', because the "
                    "points have no points_sigma_m; rig.json is in the frame asked for",
                    scene.cameras[0].name));
  }
  const Verdict verdict = finish_calibration(options.folder, adjustment, report, *progress);

  if (one_camera) {
    summary.update(json_of(adjustment, verdict, 0));
  } else {
    summary["rms_px"] = adjustment.rms_px;
    summary["cameras"] = json_of_places(adjustment, verdict);
  }
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
  fmt::print("results in {}: {}rig.json report.html{}\n", options.folder,
             one_camera ? "camera.json " : "", scene.points_m.empty() ? "" : " points.json");
}

}  // namespace

void add_calibrate_photos_command(CLI::App& calibrate, Context& context) {
  CLI::App* photos = calibrate.add_subcommand(
      "photos",
      "One camera's photos, from anywhere, of marks or (--colmap) of anything; or (--cameras) the "
      "places of cameras whose lenses are known");
  auto options = std::make_shared<PhotosOptions>();
  auto* files =
      photos->add_option("photos", options->photos, "(--colmap) Pictures, at least three");
  photos->add_option("--marks", options->marks,
                     "Marks in the photos, rough or known points, lengths and axes "
                     "(docs/formats/marks.md)");
  CLI::Option* colmap =
      photos->add_flag("--colmap", options->colmap,
                       "Find the cameras by the program colmap; marks then give scale and axes");
  photos
      ->add_option("--sheet", options->sheet,
                   "A sheet in two photos or more gives scale and axes (as for `detect`)")
      ->check(sheet_name());
  CLI::Option* cameras = photos->add_option(
      "--cameras", options->cameras,
      "Files of known cameras, in any of the formats of `calibrate convert`: each photo is by the "
      "one of its name; lenses stay as they are, places are sought");
  photos->add_option("--lens", options->lens, "Lens of the camera")
      ->check(CLI::IsMember(lens_names()))
      ->capture_default_str()
      ->excludes(cameras);
  photos
      ->add_option("--method", options->method,
                   "joint: all at once; both: beside it the loop of cameras and points in turn, "
                   "for comparison")
      ->check(CLI::IsMember({"joint", "both"}))
      ->capture_default_str()
      ->excludes(cameras);
  photos
      ->add_flag("--principal", options->principal,
                 "Seek the principal point; otherwise it is the middle of the picture")
      ->excludes(cameras);
  photos->add_flag("--keep-outliers", options->keep_outliers,
                   "Plain least squares: every mark counts");
  photos->add_option("-o,--output", options->folder, "Folder for the results")->required();
  colmap->excludes(cameras);
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
