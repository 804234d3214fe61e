#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "semblance/cloth/checkpoint.h"
#include "semblance/cloth/fabric_io.h"
#include "semblance/cloth/presets.h"
#include "semblance/cloth/rest.h"
#include "semblance/cloth/scene_io.h"
#include "semblance/core/errors.h"
#include "semblance/io/mesh_io.h"
#include "semblance/io/text.h"
#include "simulate_outputs.h"

namespace semblance::cli {
namespace {

namespace fs = std::filesystem;

struct SimulateArguments {
  std::string scene, folder, fabric, until = "rest", method = "dynamic", self_contact, scheme,
                                     model, hysteresis, format = "obj", compare, start;
  double spacing_m = 0.0;
  bool resume = false;
  SimulationOptions options;
};

const std::map<std::string, SimulationMethod> methods = {
    {"dynamic", SimulationMethod::dynamic},
    {"quasistatic", SimulationMethod::quasistatic},
    {"coarse-to-fine", SimulationMethod::coarse_to_fine}};
const std::map<std::string, TimeScheme> schemes = {{"explicit", TimeScheme::explicit_euler},
                                                   {"implicit", TimeScheme::implicit_euler},
                                                   {"bdf2", TimeScheme::bdf2}};

/// "rest" or a time.
std::optional<double> parse_until(const std::string& until) {
  if (until == "rest") return std::nullopt;
  double seconds = 0.0;
  if (!text::parse(until, seconds) || !(seconds > 0.0)) {
    throw InvalidInput("--until: 'rest' or a positive number of seconds was expected, not " +
                       text::quoted(until));
  }
  return seconds;
}

bool is_preset(const std::string& name) {
  const auto names = preset_names();
  return std::find(names.begin(), names.end(), name) != names.end();
}

SimulationSetup setup_of(const SimulateArguments& arguments) {
  const std::string& name = arguments.scene;
  if (!is_preset(name) && (fs::exists(name) || text::lower_extension(name) == ".json")) {
    return read_cloth_scene(name, arguments.fabric);
  }
  if (is_preset(name) && arguments.fabric.empty()) {
    throw InvalidInput(name + ": a preset needs its fabric; give --fabric FILE[:NAME]");
  }
  return preset_setup(name, arguments.fabric.empty() ? Fabric{} : read_fabric(arguments.fabric));
}

/// A mesh with (u, v) in metres, as another run left it.
struct OtherShape {
  std::string path;
  Sheet sheet;
  Points positions_m;

  /// Where the vertices of another sheet of the same piece of fabric lie on it.
  Points on(const Sheet& other) const {
    const Eigen::RowVector2d mine = size_m(sheet), others = size_m(other);
    if ((mine - others).norm() > 1e-3 * others.norm()) {
      throw InvalidInput(fmt::format(
          "{}: a piece of {:.3f} x {:.3f} m, and the scene's sheet has {:.3f} x {:.3f} m; start "
          "from a run of the same scene",
          path, mine[0], mine[1], others[0], others[1]));
    }
    return refine(sheet, positions_m, other);
  }
  static Eigen::RowVector2d size_m(const Sheet& sheet) {
    return sheet.material_m.colwise().maxCoeff() - sheet.material_m.colwise().minCoeff();
  }
};

OtherShape read_other_shape(const std::string& other) {
  OtherShape out;
  out.path = fs::is_directory(other) ? (fs::path(other) / "rest.obj").string() : other;
  const Mesh mesh = read_mesh(out.path);
  out.sheet = make_sheet(mesh, out.path);
  out.positions_m = mesh.positions_m;
  return out;
}

/// What options say beside the scene, on whatever the scene says itself.
void override_scene(const SimulateArguments& arguments, SimulationSetup& setup) {
  std::optional<OtherShape> start;
  if (!arguments.start.empty()) start = read_other_shape(arguments.start);
  setup.make = [make = setup.make, arguments, start](double spacing_m) {
    ClothScene scene = make(spacing_m);
    if (start) scene.start_m = start->on(scene.sheet);
    const bool own = scene.model.internal_friction != InternalFriction::none;
    const bool hysteresis = arguments.hysteresis.empty() ? own : arguments.hysteresis == "on";
    if (!arguments.model.empty()) {
      scene.model = make_sheet_model(arguments.model, hysteresis);
    }
    scene.model.internal_friction =
        hysteresis ? InternalFriction::incremental : InternalFriction::none;
    if (!arguments.self_contact.empty()) scene.self_contact = arguments.self_contact == "on";
    return scene;
  };
}

double distance_from(const OtherShape& other, const SimulationSummary& summary) {
  try {
    return shape_error_m(summary.scene.sheet, summary.state.positions_m, other.sheet,
                         other.positions_m);
  } catch (const InvalidInput& error) {
    throw InvalidInput(other.path + ": " + error.what());
  }
}

void print_summary(const SimulateArguments& arguments, const SimulationSummary& summary,
                   const nlohmann::json& figures) {
  fmt::print("{}: {} vertices, {} steps, {:.1f} s of CPU time; {}\n", arguments.scene,
             summary.scene.sheet.vertex_count(), figures["steps"].get<std::int64_t>(),
             figures["cpu_s"].get<double>(),
             summary.stopped   ? "stopped on request; --resume goes on"
             : summary.at_rest ? "at rest"
                               : "not at rest");
  fmt::print(
      "unbalanced forces {:.2e} N ({:.1e} of the weight), largest elongation {:.3f} %, "
      "compression {:.3f} %, {} penetrations\n",
      summary.residual_n, summary.residual, 1e2 * summary.largest_elongation,
      1e2 * summary.largest_compression, summary.penetrations);
  if (summary.drape) fmt::print("drape coefficient {:.1f} %\n", 1e2 * summary.drape->coefficient);
  if (figures.contains("shape_error_m")) {
    fmt::print("mean distance from {}: {:.2f} mm\n", arguments.compare,
               1e3 * figures["shape_error_m"].get<double>());
  }
  fmt::print("results in {}\n", arguments.folder);
}

void run_simulate(const Context& context, const SimulateArguments& arguments) {
  SimulationOptions options = arguments.options;
  options.until_s = parse_until(arguments.until);
  options.method = methods.at(arguments.method);
  // Near rest long steps are easy.
  if (!arguments.start.empty()) options.rest.first_step_s = 1.0;
  if (!arguments.scheme.empty()) options.step.scheme = schemes.at(arguments.scheme);
  SimulationSetup setup = setup_of(arguments);
  override_scene(arguments, setup);
  options.spacing_m = arguments.spacing_m > 0.0 ? arguments.spacing_m : setup.spacing_m;

  std::optional<OtherShape> other;
  if (!arguments.compare.empty()) other = read_other_shape(arguments.compare);

  SimulationFiles files(arguments.folder, arguments.format, arguments.resume);
  std::optional<SimulationCheckpoint> checkpoint;
  if (arguments.resume && fs::exists(files.checkpoint_path())) {
    checkpoint = read_checkpoint(files.checkpoint_path());
  } else if (arguments.resume) {
    files.warn(files.checkpoint_path() + ": there is no such file to go on from; starting anew");
    files.start_anew();
  }
  const auto progress = console_progress();
  const SimulationSummary summary =
      simulate(setup, options, files, *progress, checkpoint ? &*checkpoint : nullptr);
  nlohmann::json figures = simulation_json(summary, arguments.method, options.spacing_m);
  if (other && !summary.stopped) figures["shape_error_m"] = distance_from(*other, summary);
  files.finish(summary, options.frames_per_second);
  print_summary(arguments, summary, figures);
  write_summary(context, figures.dump(2));
  if (!summary.at_rest && !summary.stopped && !options.until_s) {
    throw SolverError(
        fmt::format("{}: no rest was reached; what was is in {}", setup.name, arguments.folder));
  }
}

void add_options(CLI::App& simulate, SimulateArguments& arguments) {
  SimulationOptions& options = arguments.options;
  simulate
      .add_option(
          "scene", arguments.scene,
          "Scene file (docs/formats/cloth-scene.md) or a preset: table, pinned, pinned-box, "
          "disc, strip")
      ->required();
  simulate.add_option("-o,--output", arguments.folder, "Folder for the results")->required();
  simulate.add_option("--fabric", arguments.fabric,
                      "Fabric file (docs/formats/fabric.md), of a table of fabrics FILE:NAME");
  simulate.add_option("--spacing", arguments.spacing_m, "Distance between vertices in metres")
      ->check(CLI::PositiveNumber);
  simulate.add_option("--until", arguments.until, "'rest', or the time to simulate in seconds")
      ->capture_default_str();
  simulate.add_option("--method", arguments.method, "dynamic, quasistatic or coarse-to-fine")
      ->check(CLI::IsMember({"dynamic", "quasistatic", "coarse-to-fine"}))
      ->capture_default_str();
  const auto on_off = [&](const char* name, std::string& value, const char* help) {
    simulate.add_option(name, value, help)->check(CLI::IsMember({"on", "off"}));
  };
  on_off("--self-contact", arguments.self_contact, "Whether the cloth meets itself (on)");
  on_off("--hysteresis", arguments.hysteresis, "Friction inside the fabric (on)");
  simulate.add_option("--model", arguments.model, "default, choi-ko or as-tension")
      ->check(CLI::IsMember({"default", "choi-ko", "as-tension"}));
  simulate.add_option("--scheme", arguments.scheme, "implicit (default), bdf2 or explicit")
      ->check(CLI::IsMember({"explicit", "implicit", "bdf2"}));
  simulate.add_option("--step", options.longest_step_s, "Largest time step in seconds")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  simulate
      .add_option("--strain-limit", options.strain_limit,
                  "Largest growth of the elongation in one step; more is warned of")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  simulate.add_option("--fps", options.frames_per_second, "Frames per second that are written")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  simulate.add_option("--format", arguments.format, "Of the frames: obj, ply, glb or none")
      ->check(CLI::IsMember({"obj", "ply", "glb", "none"}))
      ->capture_default_str();
  simulate
      .add_option("--checkpoint-every", options.checkpoint_interval_s,
                  "Save what is needed to go on every so many seconds")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  simulate.add_flag("--resume", arguments.resume, "Go on where an interrupted run stopped");
  simulate.add_option("--start-from", arguments.start,
                      "Start from another run's rest shape (folder or mesh)");
  simulate.add_option("--compare-with", arguments.compare,
                      "Also tell the mean distance from another run's rest shape (folder or mesh)");
}

}  // namespace

void add_simulate_command(CLI::App& app, Context& context) {
  CLI::App* simulate = app.add_subcommand("simulate", "Drape or swing a sheet of cloth");
  auto arguments = std::make_shared<SimulateArguments>();
  add_options(*simulate, *arguments);
  simulate->callback([&context, arguments] {
    context.action = [&context, arguments] { run_simulate(context, *arguments); };
  });
}

}  // namespace semblance::cli
