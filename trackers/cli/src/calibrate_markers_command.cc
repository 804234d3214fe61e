// `semblance calibrate markers`: cameras from round dots on any object.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <numbers>
#include <set>

#include "calibration_results.h"
#include "commands.h"
#include "drawn_photos.h"
#include "semblance/cameras/marker_calibration.h"
#include "semblance/cameras/sheet_pictures.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/core/progress.h"
#include "semblance/io/camera_io.h"
#include "semblance/io/camera_rig.h"
#include "sheet_command.h"

namespace semblance::cli {

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t kShownPictures = 6;

struct MarkersOptions {
  std::vector<std::string> files;
  std::string points, length, lens = "brown2", folder;
  DotTone tone = DotTone::any;
  double focal_px = 0.0;
  int most_frames = 200;
  bool scale_unknown = false, rig = false, square_pixels = false, centred = false,
       principal = false, keep_outliers = false;
};

/// "A:B:0.12". Names may hold colons but for the last part.
std::optional<MarkerLength> length_of(const std::string& text) {
  const std::size_t last = text.rfind(':');
  const std::size_t first = text.find(':');
  if (last == std::string::npos || first == last || first == 0 || last == first + 1) {
    return std::nullopt;
  }
  MarkerLength length{text.substr(0, first), text.substr(first + 1, last - first - 1)};
  const char* end = text.data() + text.size();
  const auto read = std::from_chars(text.data() + last + 1, end, length.length_m);
  if (read.ec != std::errc() || read.ptr != end || !(length.length_m > 0.0) ||
      !std::isfinite(length.length_m) || length.a == length.b) {
    return std::nullopt;
  }
  return length;
}

struct Detected {
  std::vector<std::string> camera_names;
  std::vector<MarkerPicture> pictures;
  std::vector<PictureName> names;
  double detect_s = 0.0;
};

void detect_in(const std::vector<std::string>& files, const MarkersOptions& options,
               Progress& progress, Detected& out) {
  const int camera = static_cast<int>(out.camera_names.size()) - 1;
  const std::size_t first = out.pictures.size();
  progress.begin("looking for dots", 0);
  for_each_picture(files, even_stride(files, options.most_frames), [&](const Picture& picture) {
    const auto start = std::chrono::steady_clock::now();
    MarkerPicture found;
    found.camera = camera;
    const auto index = static_cast<int>(out.pictures.size() - first);
    found.instant = picture.name.frame < 0 ? index : picture.name.frame;
    found.name = picture.name.text();
    found.width = picture.image.width;
    found.height = picture.image.height;
    found.follows = picture.name.frame > 0;
    found.dots = find_dots(picture.image, {.tone = options.tone});
    out.detect_s += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    out.pictures.push_back(std::move(found));
    out.names.push_back(picture.name);
    progress.update(static_cast<std::int64_t>(out.pictures.size()));
    return !progress.cancelled();
  });
  progress.end();
  if (progress.cancelled()) throw SolverError("interrupted while dots were looked for");
  // Instants of one camera are one number each, whatever mixture of files it is.
  std::set<int> instants;
  for (std::size_t i = first; i < out.pictures.size(); ++i) {
    if (instants.insert(out.pictures[i].instant).second) continue;
    for (std::size_t k = first; k < out.pictures.size(); ++k) {
      out.pictures[k].instant = static_cast<int>(k - first);
    }
    return;
  }
}

Detected detect_all(const MarkersOptions& options, Progress& progress) {
  Detected result;
  if (!options.rig) {
    result.camera_names = {"camera"};
    detect_in(options.files, options, progress, result);
    return result;
  }
  const std::vector<std::string> names = camera_names(options.files);
  for (std::size_t c = 0; c < names.size(); ++c) {
    result.camera_names.push_back(names[c]);
    detect_in({options.files[c]}, options, progress, result);
  }
  return result;
}

MarkerCalibration calibrate(const Detected& detected, const MarkersOptions& options) {
  MarkerOptions markers;
  markers.lens = *lens_from_name(options.lens);
  markers.keep_outliers = options.keep_outliers;
  if (options.focal_px > 0.0) markers.rough_focal_px = options.focal_px;
  markers.cancelled = [] { return interrupted(); };
  if (!options.points.empty()) {
    markers.aspect = !options.square_pixels;
    markers.principal = !options.centred;
    return calibrate_known_markers(detected.pictures, detected.camera_names,
                                   read_marker_points(options.points), markers);
  }
  markers.principal = options.principal;
  if (!options.length.empty()) markers.length = length_of(options.length);
  return calibrate_unknown_markers(detected.pictures, detected.camera_names[0], markers);
}

/// What a sighting's dot is drawn as.
struct DotLabel {
  std::string name;
  bool outlier = false;
};

std::map<std::pair<int, int>, DotLabel> labels_of(const MarkerCalibration& found) {
  std::map<std::pair<int, int>, DotLabel> labels;
  for (std::size_t i = 0; i < found.picture_of_sighting.size(); ++i) {
    const auto point = static_cast<std::size_t>(found.adjustment.survey.sightings[i].point);
    labels[{found.picture_of_sighting[i], found.dot_of_sighting[i]}] = {
        found.points[point].name, found.adjustment.outlier[i] != 0};
  }
  return labels;
}

std::string svg_of(const Rgb8& image, const MarkerPicture& picture, int index,
                   const std::map<std::pair<int, int>, DotLabel>& labels) {
  const double font = picture.width / 55.0, line = picture.width / 640.0;
  std::string out = svg_over(image);
  for (std::size_t j = 0; j < picture.dots.size(); ++j) {
    const Dot& dot = picture.dots[j];
    const auto label = labels.find({index, static_cast<int>(j)});
    const char* colour = label == labels.end()   ? "#98a2ab"
                         : label->second.outlier ? "#ff3b45"
                                                 : "#19c37d";
    out += fmt::format(
        "<ellipse rx=\"{:.2f}\" ry=\"{:.2f}\" transform=\"translate({:.2f} {:.2f}) "
        "rotate({:.1f})\" "
        "fill=\"none\" stroke=\"{}\" stroke-width=\"{:.2f}\"/>\n",
        dot.major_px, dot.minor_px, dot.centre_px.x(), dot.centre_px.y(),
        dot.angle_rad * 180.0 / std::numbers::pi, colour, line);
    if (label == labels.end()) continue;
    out += svg_name(dot.centre_px + Eigen::Vector2d(dot.major_px + line, 0.0), font, colour,
                    label->second.name);
  }
  return out + "</svg>\n";
}

/// Pictures spread over those that took part, drawn with their dots' names.
void add_pictures(const Detected& detected, const MarkersOptions& options,
                  const MarkerCalibration& found, CalibrationReport& report) {
  const std::set<int> used(found.picture_of_sighting.begin(), found.picture_of_sighting.end());
  const std::vector<int> all(used.begin(), used.end());
  std::map<std::string, int> shown;
  const std::size_t count = std::min(kShownPictures, all.size());
  for (std::size_t k = 0; k < count; ++k) {
    const int index = all[count > 1 ? k * (all.size() - 1) / (count - 1) : 0];
    shown[detected.pictures[static_cast<std::size_t>(index)].name] = index;
  }
  const auto labels = labels_of(found);
  for_each_picture(options.files, 1, [&](const Picture& picture) {
    const auto wanted = shown.find(picture.name.text());
    if (wanted == shown.end()) return true;
    const MarkerPicture& dots = detected.pictures[static_cast<std::size_t>(wanted->second)];
    report.pictures.push_back({fs::path(dots.name).filename().string(),
                               svg_of(picture.image, dots, wanted->second, labels)});
    return report.pictures.size() < shown.size();
  });
}

CalibrationReport report_of(const Detected& detected, const MarkersOptions& options,
                            const MarkerCalibration& found) {
  CalibrationReport report;
  report.title = fs::path(options.folder).filename().string();
  report.detect_s = detected.detect_s;
  for (const int picture : found.picture_of_sighting) {
    report.sighting_names.push_back(detected.pictures[static_cast<std::size_t>(picture)].name);
  }
  if (options.scale_unknown) {
    report.notes.emplace_back(
        "the scale is not known: all lengths are in an arbitrary unit. Give the distance of two "
        "dots, named as in the pictures, as --length d01:d02:METRES");
  }
  report.notes.insert(report.notes.end(), found.notes.begin(), found.notes.end());
  add_pictures(detected, options, found, report);
  return report;
}

void run_markers(const Context& context, const MarkersOptions& options) {
  const auto progress = console_progress();
  const Detected detected = detect_all(options, *progress);
  const MarkerCalibration found = calibrate(detected, options);
  const CalibrationReport report = report_of(detected, options, found);
  const std::vector<Camera>& cameras = found.adjustment.survey.cameras;
  const fs::path folder(options.folder);
  prepare_output_folder(options.folder);
  if (options.rig) {
    write_rig((folder / "rig.json").string(), {cameras});
  } else {
    write_camera((folder / "camera.json").string(), cameras[0]);
  }
  write_marker_points((folder / "points.json").string(), found.points);
  const Verdict verdict = finish_calibration(options.folder, found.adjustment, report, *progress);

  Json summary{{"places", options.points.empty() ? "found" : "known"},
               {"lens", options.lens},
               {"dots", found.points.size()}};
  if (options.rig) {
    summary["rms_px"] = found.adjustment.rms_px;
    summary["cameras"] = Json::array();
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      summary["cameras"].push_back(json_of(found.adjustment, verdict, c));
    }
  } else {
    summary.update(json_of(found.adjustment, verdict, 0));
  }
  summary["rms_all_px"] = found.adjustment.rms_all_px;
  summary["pictures"] = detected.pictures.size();
  summary["solve_s"] = found.adjustment.solve_s;
  summary["detect_s"] = detected.detect_s;
  add_warnings(verdict, report, summary);
  write_summary(context, summary.dump(1));
  fmt::print("results in {}: {} points.json report.html\n", options.folder,
             options.rig ? "rig.json" : "camera.json");
}

void add_camera_options(CLI::App& markers, MarkersOptions& options) {
  markers.add_option("--focal", options.focal_px, "Focal length in pixels, roughly")
      ->check(CLI::PositiveNumber);
  markers.add_option("--lens", options.lens, "The lens")
      ->check(CLI::IsMember(lens_names()))
      ->capture_default_str();
  markers.add_flag("--square-pixels", options.square_pixels,
                   "One focal length for both axes (always, without --points)");
  CLI::Option* centred =
      markers.add_flag("--centred", options.centred, "The principal point is in the middle");
  markers
      .add_flag("--principal", options.principal,
                "Without --points: the principal point is sought too")
      ->excludes(centred);
  markers.add_flag("--keep-outliers", options.keep_outliers, "Plain least squares");
}

}  // namespace

void add_calibrate_markers_command(CLI::App& calibrate, Context& context) {
  CLI::App* markers = calibrate.add_subcommand(
      "markers", "Cameras from round or reflective dots on any object, at known places or not");
  auto options = std::make_shared<MarkersOptions>();
  markers
      ->add_option("pictures", options->files,
                   "Pictures, videos, folders; with --rig one video or folder for each camera")
      ->required();
  CLI::Option_group* places = markers->add_option_group("places", "Where the dots are");
  places->add_option("--points", options->points, "Known places (docs/formats/marker-points.md)");
  places
      ->add_option("--length", options->length,
                   "Unknown places; the distance of two dots in metres, as in d03:d11:0.12")
      ->check([](const std::string& text) {
        return length_of(text) ? std::string()
                               : text +
                                     ": two names and a length in metres were expected, as in "
                                     "d03:d11:0.12";
      });
  places->add_flag("--scale-unknown", options->scale_unknown, "Unknown places, unknown scale");
  places->require_option(1);
  markers->add_flag("--rig", options->rig,
                    "Several cameras: files of one number show one instant (needs --points)");
  const std::map<std::string, DotTone> tones{
      {"any", DotTone::any}, {"dark", DotTone::dark}, {"light", DotTone::light}};
  markers->add_option("--dots", options->tone, "Dots against their ground: any, dark or light")
      ->transform(CLI::CheckedTransformer(tones));
  markers->add_option("--most-frames", options->most_frames, "Of a video, in even steps; 0 for all")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  add_camera_options(*markers, *options);
  markers->add_option("-o,--output", options->folder, "Folder for the results")->required();
  markers->callback([&context, options] {
    if (options->rig && options->points.empty()) {
      throw CLI::ValidationError("--rig", "several cameras need --points");
    }
    if (options->rig && options->files.size() < 2) {
      throw CLI::ValidationError("--rig", "a video or folder for each camera was expected");
    }
    context.action = [&context, options] { run_markers(context, *options); };
  });
}

}  // namespace semblance::cli
