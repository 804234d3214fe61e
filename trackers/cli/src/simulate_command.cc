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
  int drapes = 1;
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

SimulationSetup scene_of(const SimulateArguments& arguments, int start) {
  const std::string& name = arguments.scene;
  if (!is_preset(name) && (fs::exists(name) || text::lower_extension(name) == ".json")) {
    return read_cloth_scene(name, arguments.fabric);
  }
  if (is_preset(name) && arguments.fabric.empty()) {
    throw InvalidInput(name + ": a preset needs its fabric; give --fabric FILE[:NAME]");
  }
  return preset_setup(name, read_fabric(arguments.fabric), start);
}

/// A mesh with (u, v) in metres, as another run left it.
struct OtherShape {
  std::string path;
  Sheet sheet;
  Points positions_m;
  std::optional<SimulationCheckpoint> end;  // the state that it was left in

  bool is_of(const Sheet& other) const {
    return other.triangles.rows() == sheet.triangles.rows() && other.triangles == sheet.triangles;
  }
  /// Lets the scene begin here.
  void start(ClothScene& scene) const {
    check_size(scene.sheet);
    if (!end || !is_of(scene.sheet)) {
      scene.start_m = refine(sheet, positions_m, scene.sheet);
      return;
    }
    scene.start_m = end->state.positions_m;
    scene.start_friction = end->state.friction;
    scene.start_barrier_factor = end->barrier_factor;
  }
  /// Refuses another piece of fabric.
  void check_size(const Sheet& other) const {
    const Eigen::RowVector2d mine = size_m(sheet), others = size_m(other);
    if ((mine - others).norm() > 1e-3 * others.norm()) {
      throw InvalidInput(fmt::format(
          "{}: a piece of {:.3f} x {:.3f} m, and the scene's sheet has {:.3f} x {:.3f} m; start "
          "from a run of the same scene",
          path, mine[0], mine[1], others[0], others[1]));
    }
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

/// The shape, and the state where it is known.
OtherShape read_start(const std::string& other) {
  OtherShape out = read_other_shape(other);
  const std::string state = (fs::path(other) / "rest.bin").string();
  if (!fs::is_directory(other) || !fs::exists(state)) return out;
  out.end = read_checkpoint(state);
  if (out.end->state.positions_m.rows() != out.positions_m.rows()) {
    throw InvalidInput(state + ": is not of " + out.path +
                       "; remove it to start from that shape alone");
  }
  return out;
}

/// What options say beside the scene, on whatever the scene says itself.
void override_scene(const SimulateArguments& arguments, SimulationSetup& setup) {
  std::optional<OtherShape> start;
  if (!arguments.start.empty()) start = read_start(arguments.start);
  setup.make = [make = setup.make, arguments, start](double spacing_m) {
    ClothScene scene = make(spacing_m);
    if (start) start->start(scene);
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

SimulationSetup setup_of(const SimulateArguments& arguments, int start) {
  SimulationSetup setup = scene_of(arguments, start);
  override_scene(arguments, setup);
  return setup;
}

/// Which of several shapes a drape comes to depends on how it starts: the same from other starts.
/// The last one is not whole where it was stopped.
std::vector<SimulationSummary> drape_again(const SimulateArguments& arguments,
                                           const SimulationOptions& options, Progress& progress) {
  std::vector<SimulationSummary> out;
  for (int k = 1; k < arguments.drapes; ++k) {
    SimulationSink nothing_written;
    out.push_back(
        simulate(setup_of(arguments, first_start + k), options, nothing_written, progress));
    if (out.back().stopped) break;
  }
  return out;
}

/// The mean of all drapes for that of the first, and each of them.
void add_drapes(const SimulationSummary& first, const std::vector<SimulationSummary>& others,
                nlohmann::json& figures) {
  std::vector<double> coefficients;
  const auto add = [&](const SimulationSummary& summary) {
    if (summary.stopped) return;
    coefficients.push_back(summary.drape->coefficient);
    figures["drapes"].push_back({{"drape_coefficient", summary.drape->coefficient},
                                 {"at_rest", summary.at_rest},
                                 {"relative_residual", summary.residual},
                                 {"penetrations", summary.penetrations}});
  };
  add(first);
  for (const SimulationSummary& other : others) add(other);
  const Eigen::Map<const Eigen::VectorXd> all(coefficients.data(),
                                              static_cast<Eigen::Index>(coefficients.size()));
  figures["drape_coefficient"] = all.mean();
  if (all.size() < 2) return;
  figures["drape_coefficient_deviation"] =
      (all.array() - all.mean()).matrix().norm() / std::sqrt(static_cast<double>(all.size() - 1));
}

void print_drapes(const nlohmann::json& figures) {
  const double percent = 1e2 * figures["drape_coefficient"].get<double>();
  if (figures["drape_coefficient_deviation"].is_null()) {
    fmt::print("drape coefficient {:.1f} %, of one drape: --drapes tells how much it varies\n",
               percent);
    return;
  }
  fmt::print("drape coefficient {:.1f} %, the mean of {} drapes that deviate by {:.1f}\n", percent,
             figures["drapes"].size(), 1e2 * figures["drape_coefficient_deviation"].get<double>());
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
  if (figures.contains("drapes")) print_drapes(figures);
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
  const SimulationSetup setup = setup_of(arguments, first_start);
  if (arguments.drapes > 1 && !setup.drape) {
    throw InvalidInput(setup.name + ": --drapes is for drape tests: the preset disc");
  }
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
  bool at_rest = summary.at_rest, stopped = summary.stopped;
  if (summary.drape && !stopped) {
    const std::vector<SimulationSummary> others = drape_again(arguments, options, *progress);
    for (const SimulationSummary& drape : others) {
      at_rest = at_rest && drape.at_rest;
      stopped = stopped || drape.stopped;
    }
    add_drapes(summary, others, figures);
  }
  print_summary(arguments, summary, figures);
  write_summary(context, figures.dump(2));
  if (!at_rest && !stopped && !options.until_s) {
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
  simulate
      .add_option("--drapes", arguments.drapes,
                  "Drape tests: so many drapes from slightly different starts; the first is "
                  "written, the mean and deviation of all are told")
      ->check(CLI::Range(1, 1000))
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
