#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "semblance/core/errors.h"
#include "semblance/io/camera_formats.h"

namespace semblance::cli {

namespace {

struct ConvertOptions {
  std::string in, out, from, to, camera;
  double metres_per_unit = 1.0;
};

std::vector<std::string> format_names() {
  std::vector<std::string> names;
  for (const CameraFormat* format : camera_formats()) names.emplace_back(format->name);
  return names;
}

void keep_one(CameraFile& file, const std::string& name, const std::string& source) {
  const std::vector<Camera>& cameras = file.rig.cameras;
  const auto found = std::find_if(cameras.begin(), cameras.end(),
                                  [&](const Camera& camera) { return camera.name == name; });
  if (found == cameras.end()) {
    std::vector<std::string> names;
    for (const Camera& camera : cameras) names.push_back("'" + camera.name + "'");
    throw InvalidInput(
        fmt::format("{}: has no camera '{}'; it has {}", source, name, fmt::join(names, ", ")));
  }
  file.rig.cameras = {*found};
  file.model.reset();
}

/// What is lost or was assumed, said where it cannot be missed.
void report(const std::string& path, const std::vector<std::string>& notes) {
  for (const std::string& note : notes) fmt::print(stderr, "{}: {}\n", path, note);
}

std::string summary(const CameraFile& file, const CameraFormat& from, const CameraFormat& to,
                    const std::vector<std::string>& notes) {
  nlohmann::ordered_json json{{"from", from.name}, {"to", to.name}};
  for (const Camera& camera : file.rig.cameras) {
    json["cameras"].push_back({{"name", camera.name},
                               {"lens", lens_name(camera.lens)},
                               {"size_px", {camera.width, camera.height}}});
  }
  json["images"] = file.model ? file.model->images.size() : 0;
  json["points"] = file.model ? file.model->points.size() : 0;
  json["notes"] = notes;
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace);
}

void run_convert(const Context& context, const ConvertOptions& options) {
  const CameraFormat& from =
      options.from.empty() ? recognise_camera_file(options.in) : *find_camera_format(options.from);
  const CameraFormat& to =
      options.to.empty() ? format_for_writing(options.out) : *find_camera_format(options.to);
  fmt::print(stderr, "{}: read as {} ({})\n", options.in, from.name, from.title);
  CameraFile file = read_cameras(options.in, from, options.metres_per_unit);
  report(options.in, file.notes);
  if (!options.camera.empty()) keep_one(file, options.camera, options.in);
  fmt::print(stderr, "{}: written as {} ({})\n", options.out, to.name, to.title);
  const std::vector<std::string> losses = write_cameras(options.out, file, to);
  report(options.out, losses);
  fmt::print("{}: {} camera{}\n", options.out, file.rig.cameras.size(),
             file.rig.cameras.size() == 1 ? "" : "s");
  std::vector<std::string> notes = file.notes;
  notes.insert(notes.end(), losses.begin(), losses.end());
  write_summary(context, summary(file, from, to, notes));
}

}  // namespace

void add_calibrate_convert_command(CLI::App& calibrate, Context& context) {
  auto options = std::make_shared<ConvertOptions>();
  CLI::App* convert = calibrate.add_subcommand(
      "convert", "Camera files of other programs, in and out (docs/formats/cameras-elsewhere.md)");
  convert->add_option("in", options->in, "File to read; for COLMAP a folder")->required();
  convert->add_option("out", options->out, "File to write; for COLMAP a folder")->required();
  convert->add_option("--from", options->from, "Format of the input (by its content)")
      ->check(CLI::IsMember(format_names()));
  convert->add_option("--to", options->to, "Format of the output (by its name)")
      ->check(CLI::IsMember(format_names()));
  convert->add_option("--camera", options->camera, "Write this camera only");
  convert
      ->add_option("--metres-per-unit", options->metres_per_unit,
                   "Length of the input's unit, where its format leaves that open (0.001: mm)")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  convert->callback([&context, options] {
    context.action = [&context, options] { run_convert(context, *options); };
  });
}

}  // namespace semblance::cli
