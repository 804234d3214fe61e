#include "sheet_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <sstream>

#include "calibration_results.h"
#include "semblance/core/errors.h"
#include "semblance/io/camera_formats.h"

namespace semblance::cli {

namespace {

namespace fs = std::filesystem;
// A length measured by hand, between two cameras or two points of the sheet.
struct MeasuredDistance {
  std::string from, to;
  double length_m = 0.0;
};

std::optional<MeasuredDistance> parse_distance(const std::string& text) {
  std::istringstream stream(text);
  MeasuredDistance distance;
  std::string length;
  std::getline(stream, distance.from, ':');
  std::getline(stream, distance.to, ':');
  std::getline(stream, length);
  const CLI::Range positive(1e-6, 1e6);
  if (distance.from.empty() || distance.to.empty() || !positive(length).empty()) return {};
  distance.length_m = std::stod(length);
  return distance;
}

Eigen::Vector3d sheet_point(const Target& target, const std::string& id,
                            const std::vector<Camera>& cameras) {
  const std::vector<int> ids = point_ids(target);
  const auto found =
      std::find_if(ids.begin(), ids.end(), [&](int known) { return std::to_string(known) == id; });
  if (found != ids.end()) return point_on_sheet(target, *found);
  std::vector<std::string> names;
  for (const Camera& camera : cameras) names.push_back(camera.name);
  throw InvalidInput(fmt::format(
      "--distance: '{}' is no point of {} (they are numbered {} to {}){}", id, target_text(target),
      ids.front(), ids.back(),
      names.empty() ? "" : fmt::format(", and not one of the cameras {}", fmt::join(names, ", "))));
}

// The same distance by the calibration; cameras by their names, or points by their numbers.
double distance_m(const MeasuredDistance& measured, const Target& target,
                  const std::vector<Camera>& cameras) {
  std::vector<Eigen::Vector3d> ends;
  for (const std::string& name : {measured.from, measured.to}) {
    for (const Camera& camera : cameras) {
      if (camera.name == name) ends.push_back(camera.camera_from_world.inverse().translation_m);
    }
  }
  if (ends.size() == 2) return (ends[0] - ends[1]).norm();
  return (sheet_point(target, measured.from, cameras) - sheet_point(target, measured.to, cameras))
      .norm();
}

// Speed of each point in the picture from the frames beside it, where those show it.
Eigen::Matrix2Xd velocities(const SheetPictures& pictures, std::size_t index, double rate) {
  const Detection& now = pictures.detections[index];
  Eigen::Matrix2Xd result(2, now.points_px.cols());
  const auto place_in = [&](std::size_t frame, int id) -> std::optional<Eigen::Vector2d> {
    if (frame >= pictures.detections.size()) return std::nullopt;  // also before the first
    const Detection& detection = pictures.detections[frame];
    const auto found = std::lower_bound(detection.ids.begin(), detection.ids.end(), id);
    if (found == detection.ids.end() || *found != id) return std::nullopt;
    return detection.points_px.col(found - detection.ids.begin());
  };
  for (std::size_t k = 0; k < now.ids.size(); ++k) {
    const auto column = static_cast<Eigen::Index>(k);
    const auto before = place_in(index - 1, now.ids[k]), after = place_in(index + 1, now.ids[k]);
    const Eigen::Vector2d here = now.points_px.col(column);
    const double steps = (before ? 1.0 : 0.0) + (after ? 1.0 : 0.0);  // 0: not a number
    result.col(column) = (after.value_or(here) - before.value_or(here)) * rate / steps;
  }
  return result;
}

}  // namespace

void add_notes(const SheetPictures& pictures, std::vector<std::string>& notes) {
  std::map<std::string, int> counts;
  for (const Detection& detection : pictures.detections) {
    for (const DetectionWarning& warning : detection.warnings) ++counts[warning.text];
  }
  for (const auto& [text, count] : counts) {
    notes.push_back(count > 1 ? fmt::format("{} ({} pictures)", text, count) : text);
  }
}

void note_size(const Target& asked, std::vector<std::string>& notes) {
  if (asked.kind == TargetKind::automatic && !(asked.size_m > 0.0)) {
    notes.emplace_back(
        "the sheet's size is not known: 1 m was assumed, and distances are in that unit; give it "
        "as in auto:0.025");
  }
}

void check_distances(const SheetOptions& options, const Target& target,
                     const std::vector<Camera>& cameras, std::vector<std::string>& notes) {
  constexpr double tolerance = 0.01;  // a millimetre in ten centimetres
  for (const std::string& text : options.distances) {
    const MeasuredDistance measured = *parse_distance(text);
    const double found_m = distance_m(measured, target, cameras);
    const double ratio = measured.length_m / found_m;
    if (std::abs(ratio - 1.0) <= tolerance) continue;
    const auto resized = [&](double length_m) {
      return std::stod(fmt::format("{:.4g}", ratio * length_m));
    };
    Target other = target;
    other.size_m = resized(target.size_m);
    other.marker_m = resized(target.marker_m);
    notes.push_back(fmt::format(
        "from {} to {} you measured {:.4g} m, but it is {:.4g} m if the sheet is {}: one of the "
        "two is wrong. If your measure is right, the sheet is {}, and all lengths are {:.4g} times "
        "as long",
        measured.from, measured.to, measured.length_m, found_m, target_text(target),
        target_text(other), ratio));
  }
}

std::vector<std::string> camera_names(const std::vector<std::string>& files,
                                      const std::vector<std::string>& given) {
  if (!given.empty() && given.size() != files.size()) {
    throw InvalidInput(fmt::format("--names has {} names for {} cameras; one for each is needed",
                                   given.size(), files.size()));
  }
  std::vector<std::string> names;
  for (std::size_t i = 0; i < files.size(); ++i) {
    fs::path path(files[i]);
    if (!path.has_filename()) path = path.parent_path();
    names.push_back(given.empty() ? path.stem().string() : given[i]);
    if (std::count(names.begin(), names.end(), names.back()) > 1) {
      throw InvalidInput(
          fmt::format("two cameras are named '{}'; give the files different names, or the cameras "
                      "theirs with --names",
                      names.back()));
    }
  }
  return names;
}

std::vector<Camera> given_cameras(const std::vector<std::string>& files) {
  std::vector<Camera> cameras;
  std::map<std::string, std::string> file_of;
  for (const std::string& file : files) {
    for (Camera& camera : read_cameras(file, recognise_camera_file(file)).rig.cameras) {
      const auto [entry, is_new] = file_of.emplace(camera.name, file);
      if (!is_new) {
        throw InvalidInput(
            fmt::format("{} and {} both have a camera '{}'; calibrate with "
                        "`board --name`, or change one of the names",
                        entry->second, file, camera.name));
      }
      cameras.push_back(std::move(camera));
    }
  }
  return cameras;
}

Rgb8 first_picture(const std::string& file) {
  Rgb8 first;
  for_each_picture({file}, 1, [&](const Picture& picture) {
    first = picture.image;
    return false;
  });
  return first;
}

std::vector<RigView> rig_views(const std::vector<SheetPictures>& pictures, bool with_velocities) {
  std::vector<RigView> views;
  for (std::size_t c = 0; c < pictures.size(); ++c) {
    for (std::size_t i = 0; i < pictures[c].names.size(); ++i) {
      if (!pictures[c].detections[i].found()) continue;
      const PictureName& name = pictures[c].names[i];
      RigView view;
      view.camera = static_cast<int>(c);
      view.instant = name.frame < 0 ? static_cast<int>(i) : name.frame;
      view.name = name.text();
      view.detection = pictures[c].detections[i];
      if (with_velocities) {
        view.velocities_px_s = velocities(pictures[c], i, pictures[c].frames_per_second[0]);
      }
      views.push_back(std::move(view));
    }
  }
  return views;
}

void add_sheet_options(CLI::App& command, SheetOptions& options) {
  command.add_option("--target", options.target, "The sheet, as for `calibrate detect`")
      ->required()
      ->check(sheet_name());
  command.add_option("--lens", options.lens, "Lens of the cameras")
      ->check(CLI::IsMember(lens_names()))
      ->capture_default_str();
  command.add_option("-o,--output", options.folder, "Folder for the results")->required();
  command
      .add_option("--most-frames", options.most_frames,
                  "Look at no more than so many frames of a video, in even steps (0: at all)")
      ->check(CLI::Range(0, 1000000))
      ->capture_default_str();
  command
      .add_option("--distance", options.distances,
                  "A length measured by hand, to check the sheet's size: A:B:METRES between two "
                  "points of the sheet (their numbers) or two cameras of a rig (their names)")
      ->check(CLI::Validator(
          [](const std::string& text) {
            return parse_distance(text) ? "" : "expected A:B:METRES, as in left:right:0.3";
          },
          "A:B:METRES"))
      ->allow_extra_args(false);
  command.add_flag("--square-pixels", options.square_pixels, "Both axes have one focal length");
  command.add_flag("--centred", options.centred,
                   "The principal point is the middle of the picture");
  command.add_flag("--warp", options.warp, "The sheet may be bent");
  command.add_flag("--keep-outliers", options.keep_outliers,
                   "Plain least squares: every point counts");
}

}  // namespace semblance::cli
