#include "semblance/cloth/simulation.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <memory>
#include <numbers>

#include "byte_sum.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

/// Steps grow again after so many that were easy.
constexpr int easy_steps_to_grow = 4;

/// A hit at speed needs many iterations however short the step: after so many halvings they are
/// allowed this many times what they were.
constexpr int halvings_to_insist = 3, insistence = 10;

/// Contact forces are sized for cloth that lies. Where it hits something at speed, or a corner
/// holds much of it, they may stop it only at gaps too small to compute with. So they grow where a
/// gap is below a fraction of its reach, and where steps fail: more for hits than on the way to
/// rest.
struct Strengthening {
  double small_gap, growth;
};
constexpr Strengthening for_hits{0.05, 4.0}, for_rest{0.02, 2.0};
constexpr double largest_barrier_factor = 4096.0;

/// Of the refined shape and the flat start: how much of the latter is tried, one after the other,
/// where the refined shape crosses something.
constexpr double start_shares[] = {0.01, 0.03, 0.1, 0.3};

double wall_clock_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}
double cpu_clock_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

double mean_edge_m(const Mesh& mesh) {
  double sum_m = 0.0;
  for (const auto& triangle : mesh.triangles.rowwise()) {
    for (int k = 0; k < 3; ++k) {
      sum_m +=
          (mesh.positions_m.row(triangle[k]) - mesh.positions_m.row(triangle[(k + 1) % 3])).norm();
    }
  }
  return sum_m / (3.0 * static_cast<double>(mesh.triangles.rows()));
}

bool moves(const ClothScene& scene) {
  return std::any_of(scene.obstacles.begin(), scene.obstacles.end(), is_moving);
}

// ---- the name of a run

class Key {
 public:
  template <class T>
  void add(const T* values, std::size_t count) {
    sum_ = byte_sum({reinterpret_cast<const char*>(values), count * sizeof(T)}, sum_);
  }
  void add(double value) { add(&value, 1); }
  void add(const std::string& text) { add(text.data(), text.size()); }
  void add(const Curve& curve) {
    add(curve.x().data(), curve.x().size());
    add(curve.values().data(), curve.values().size());
  }
  void add(const ModeResponse& mode) {
    add(mode.elastic);
    add(mode.friction);
    add(mode.reversal);
    add(mode.viscosity_s);
  }
  template <class Matrix>
  void add_matrix(const Matrix& matrix) {
    add(matrix.data(), static_cast<std::size_t>(matrix.size()));
  }
  std::uint64_t sum() const { return sum_; }

 private:
  std::uint64_t sum_ = byte_sum("");
};

void add_fabric(Key& key, const Fabric& fabric) {
  for (const double value :
       {fabric.area_density_kg_m2, fabric.thickness_m, fabric.friction, fabric.mass_damping_1_s}) {
    key.add(value);
  }
  for (const auto& modes : {fabric.tension, fabric.bending}) {
    for (const ModeResponse& mode : modes) key.add(mode);
  }
  key.add(fabric.shear);
  if (fabric.bending_bias) key.add(*fabric.bending_bias);
}

/// A motion is known by some of its places.
void add_obstacle(Key& key, const Obstacle& obstacle) {
  const Mesh mesh = obstacle_mesh(obstacle, 0.0);
  key.add(obstacle.name);
  key.add_matrix(mesh.positions_m);
  key.add_matrix(mesh.triangles);
  if (!is_moving(obstacle)) return;
  for (double time_s = 0.1; time_s < 100.0; time_s *= 1.5) {
    key.add_matrix(obstacle_mesh(obstacle, time_s).positions_m);
  }
}

void add_scene(Key& key, const ClothScene& scene) {
  key.add_matrix(scene.sheet.material_m);
  key.add_matrix(scene.sheet.triangles);
  key.add_matrix(scene.start_m);
  key.add(scene.fixed.data(), scene.fixed.size());
  key.add_matrix(scene.gravity_m_s2);
  add_fabric(key, scene.fabric);
  for (const double value :
       {static_cast<double>(scene.model.bending), static_cast<double>(scene.model.compression),
        static_cast<double>(scene.model.internal_friction), scene.model.buckling_wavelength_m,
        scene.self_contact ? 1.0 : 0.0, static_cast<double>(scene.start_friction.size()),
        scene.start_barrier_factor}) {
    key.add(value);
  }
  for (const Obstacle& obstacle : scene.obstacles) add_obstacle(key, obstacle);
}

// ---- options

void require(bool holds, const std::string& what) {
  if (!holds) throw InvalidInput(what);
}

void check_options(const SimulationSetup& setup, const SimulationOptions& options,
                   const ClothScene& scene) {
  const bool dynamic = options.method == SimulationMethod::dynamic;
  require(
      options.longest_step_s > 0.0 && options.smallest_step_s > 0.0 &&
          options.longest_step_s >= options.smallest_step_s,
      fmt::format("{}: the longest step, {} s, must be positive and not below the smallest, {} s",
                  setup.name, options.longest_step_s, options.smallest_step_s));
  require(options.frames_per_second > 0.0,
          setup.name + ": the number of frames per second must be positive");
  require(options.strain_limit > 0.0, setup.name + ": the strain limit must be positive");
  require(!options.until_s || *options.until_s > 0.0,
          setup.name + ": the time to simulate must be positive");
  require(dynamic || !options.until_s,
          setup.name +
              ": quasi-static methods know no time; let them run until rest, or choose dynamic");
  require(options.method != SimulationMethod::coarse_to_fine || setup.has_spacing,
          setup.name +
              ": the sheet is a mesh of its own and has no coarser ones; choose dynamic or "
              "quasistatic");
  if (!moves(scene)) return;
  require(dynamic && options.until_s.has_value(),
          setup.name +
              ": a body moves, so there is no rest; choose dynamic and give the time to simulate");
}

/// Spacings from coarse to fine. Sheets of any spacing come by the same coarse ones, each half of
/// the one before: which of the shapes at rest is reached is decided there, and then they agree.
std::vector<double> level_spacings(const SimulationSetup& setup, const SimulationOptions& options) {
  // Levels nearer to the finest than that are not worth their time.
  const double least_ratio = 1.2;
  std::vector<double> spacings;
  if (options.method == SimulationMethod::coarse_to_fine) {
    double spacing_m = options.coarsest_spacing_m;
    for (; spacing_m >= least_ratio * options.spacing_m; spacing_m *= 0.5) {
      try {
        setup.make(spacing_m);
      } catch (const InvalidInput&) {
        continue;  // too coarse for this sheet
      }
      spacings.push_back(spacing_m);
    }
  }
  spacings.push_back(options.spacing_m);
  return spacings;
}

// ---- one run

class Run {
 public:
  Run(const SimulationSetup& setup, const SimulationOptions& options, SimulationSink& sink,
      Progress& progress)
      : setup_(setup), options_(options), sink_(sink), progress_(progress) {}

  SimulationSummary run(const SimulationCheckpoint* resume);

 private:
  bool dynamic() const { return options_.method == SimulationMethod::dynamic; }
  SimulationLevel& level() { return now_.levels.back(); }
  int level_index() const { return static_cast<int>(now_.levels.size()) - 1; }

  void open(double spacing_m);
  void begin_level(double spacing_m);
  void begin_from(const ClothScene& coarse, const Points& positions_m);
  void resume_at(const SimulationCheckpoint& checkpoint, const std::vector<double>& spacings);

  void warn_of_fine_bodies(const ClothScene& scene) const;
  void warn_of_long_steps() const;
  void run_dynamic();
  bool dynamic_done();
  bool nearly_still() const;
  void set_tolerances();
  void advance();
  bool try_step(double step_s, StepReport& report);
  double slice() const;
  double smallest_gap();
  double largest_elongation();
  void strengthen_contact(const Strengthening& how);
  void settle_level();

  void record(const StepReport& report, double step_s);
  void note_strain(double elongation);
  void write_frame();
  void tick();
  void save();
  void save_if_due();
  SimulationSummary summary();

  const SimulationSetup& setup_;
  const SimulationOptions& options_;
  SimulationSink& sink_;
  Progress& progress_;
  std::unique_ptr<ClothSystem> system_;
  SimulationCheckpoint now_;  // the run's state, whole
  double elongation_ = 0.0;
  bool stopped_ = false, resumed_ = false, said_short_ = false;
  // Clocks at the last tick.
  double cpu_s_ = cpu_clock_s(), wall_s_ = wall_clock_s(), contact_s_ = 0.0;
  double saved_s_ = wall_clock_s();
};

void Run::open(double spacing_m) {
  ClothScene scene = setup_.make(spacing_m);
  StepOptions step = options_.step;
  if (!dynamic()) {
    step.scheme = TimeScheme::quasistatic;
    // There is no time to follow loops through.
    InternalFriction& friction = scene.model.internal_friction;
    if (friction != InternalFriction::none) friction = InternalFriction::monotone;
  }
  if (scene.sheet.grid) {
    step.linear_solver = dynamic() ? "lines" : "two-level";
  } else {
    step.linear_solver = dynamic() ? "jacobi" : "direct";
  }
  system_ = std::make_unique<ClothSystem>(std::move(scene), step);
  contact_s_ = 0.0;
}

void Run::begin_level(double spacing_m) {
  open(spacing_m);
  const ClothScene& scene = system_->scene();
  if (const auto problem = system_->contacts().start_problem(scene.start_m)) {
    throw InvalidInput(setup_.name + ": cannot start: " + *problem +
                       "; place the sheet so that it is clear of bodies and of itself");
  }
  now_.levels.push_back({.spacing_m = spacing_m,
                         .vertices = scene.sheet.vertex_count(),
                         .start = "the scene's start"});
  now_.state = system_->start();
  now_.barrier_factor = scene.start_barrier_factor;
  system_->contact_law().barrier_pa *= now_.barrier_factor;
  now_.pace = {.step_s = options_.rest.first_step_s};
}

/// Goes on with the shape of a coarser sheet. Finer triangles need not lie in coarser ones, so they
/// may cut through an edge that the coarser ones had passed.
void Run::begin_from(const ClothScene& coarse, const Points& positions_m) {
  const ClothScene& scene = system_->scene();
  Points refined = refine(coarse.sheet, positions_m, scene.sheet);
  for (const int v : scene.fixed) refined.row(v) = scene.start_m.row(v);
  const auto start_at = [&](const Points& start, const std::string& which) {
    level().start = which;
    now_.state.positions_m = start;
    now_.state.memory = system_->energy().memory_at(start);
    now_.state.friction.clear();
  };
  Points pushed = refined;
  const double pushed_m = system_->contacts().push_out(pushed, 0.05 * level().spacing_m);
  for (const int v : scene.fixed) pushed.row(v) = scene.start_m.row(v);
  if (!system_->contacts().start_problem(pushed)) {
    start_at(pushed, pushed_m == 0.0
                         ? "the coarser shape"
                         : fmt::format("the coarser shape, pushed out of bodies by up to {:.1f} mm",
                                       1e3 * pushed_m));
  } else {
    const std::string crosses =
        "because it crosses: " + system_->contacts().start_problem(refined).value_or("");
    for (const double share : start_shares) {
      const Points start = (1.0 - share) * refined + share * scene.start_m;
      if (system_->contacts().start_problem(start)) continue;
      start_at(start,
               fmt::format("the coarser shape, with {:g} % of the scene's start mixed in, {}",
                           100.0 * share, crosses));
      break;
    }
    if (level().start == "the scene's start") {
      level().start += ", not from the coarser shape, " + crosses;
    }
    sink_.warn(fmt::format("level of {:g} m starts from {}", level().spacing_m, level().start));
  }
  system_->contacts().update(now_.state.positions_m, 0.0);
}

void Run::resume_at(const SimulationCheckpoint& checkpoint, const std::vector<double>& spacings) {
  const std::size_t levels = checkpoint.levels.size();
  if (levels == 0 || levels > spacings.size()) {
    throw InvalidInput(setup_.name + ": the checkpoint has another number of levels");
  }
  open(spacings[levels - 1]);
  const ClothState& state = checkpoint.state;
  const Eigen::Index vertices = system_->scene().sheet.vertex_count();
  const std::size_t rows = system_->energy().deformation().row_count();
  const auto may_be_empty = [&](const Points& p) { return p.rows() == 0 || p.rows() == vertices; };
  if (state.positions_m.rows() != vertices || state.velocities_m_s.rows() != vertices ||
      !may_be_empty(state.previous_positions_m) || !may_be_empty(state.previous_velocities_m_s) ||
      state.memory.anchor.size() != rows || state.memory.previous.size() != rows) {
    throw InvalidInput(setup_.name + ": the checkpoint is of another sheet");
  }
  now_ = checkpoint;
  system_->contact_law().barrier_pa *= now_.barrier_factor;
  resumed_ = true;
  if (!now_.rows.empty()) elongation_ = now_.rows.back().elongation;
  system_->contacts().update(state.positions_m, state.time_s);
}

/// Bodies' files in another unit than metres become dolls, or the cloth lies in a pore of theirs.
void Run::warn_of_fine_bodies(const ClothScene& scene) const {
  for (const Obstacle& obstacle : scene.obstacles) {
    if (!obstacle.surface || obstacle.surface->triangles.rows() == 0) continue;
    const double edge_m = mean_edge_m(*obstacle.surface);
    if (edge_m >= scene.fabric.thickness_m) continue;
    sink_.warn(fmt::format(
        "{}: its edges are {:.2g} mm long on average, less than the cloth is thick ({:.2g} mm), "
        "which makes contact slow and may keep the cloth from rest; is its scale right?",
        obstacle.name, 1e3 * edge_m, 1e3 * scene.fabric.thickness_m));
  }
}

SimulationSummary Run::run(const SimulationCheckpoint* resume) {
  const ClothScene finest = setup_.make(options_.spacing_m);
  check_options(setup_, options_, finest);
  const std::vector<double> spacings = level_spacings(setup_, options_);
  now_.key = simulation_key(finest, options_);
  if (resume != nullptr) {
    if (resume->key != now_.key) {
      throw InvalidInput(setup_.name +
                         ": the checkpoint is of a run with another scene or other options; give "
                         "those, or start anew without it");
    }
    resume_at(*resume, spacings);
  } else {
    begin_level(spacings.front());
  }
  sink_.begin();
  warn_of_fine_bodies(finest);
  for (;;) {
    dynamic() ? run_dynamic() : settle_level();
    tick();
    if (stopped_) {
      save();
      break;
    }
    if (now_.levels.size() == spacings.size()) break;
    sink_.level_done(level_index(), level(), system_->scene().sheet, now_.state.positions_m);
    const ClothScene coarse = system_->scene();
    const Points shape = now_.state.positions_m;
    begin_level(spacings[now_.levels.size()]);
    begin_from(coarse, shape);
    resumed_ = false;
  }
  return summary();
}

// ---- through time

/// Implicit steps bear any length, but what swings within a few of them is damped away.
void Run::warn_of_long_steps() const {
  constexpr double usual_s = 0.05;
  const double given_s = options_.longest_step_s, frame_s = 1.0 / options_.frames_per_second;
  if (given_s <= usual_s) return;
  if (frame_s < given_s) {
    sink_.warn(fmt::format("steps of {:g} s are cut to {:g} s, the time between frames", given_s,
                           frame_s));
  }
  if (std::min(given_s, frame_s) <= usual_s) return;
  sink_.warn(fmt::format(
      "steps of {:g} s are too long for cloth in motion: swings and hits within a few steps are "
      "damped away; choose 0.01 s or less",
      std::min(given_s, frame_s)));
}

void Run::run_dynamic() {
  warn_of_long_steps();
  if (!resumed_) {
    now_.pace.step_s = options_.longest_step_s;
    now_.shortest_step_s = options_.longest_step_s;
    write_frame();
  }
  const double total_s = options_.until_s.value_or(0.0);
  progress_.begin("simulated ms", std::llround(1e3 * total_s));
  while (!dynamic_done()) {
    if (progress_.cancelled()) {
      stopped_ = true;
      break;
    }
    save_if_due();
    advance();
    progress_.update(std::llround(1e3 * now_.state.time_s));
  }
  progress_.end();
}

bool Run::dynamic_done() {
  if (now_.rows.empty()) return false;
  const SimulationRow& row = now_.rows.back();
  level().at_rest = row.speed_m_s < options_.rest_speed_m_s && row.residual &&
                    *row.residual < options_.rest_residual;
  const double end_s = options_.until_s.value_or(options_.longest_time_s);
  return now_.state.time_s >= end_s - 1e-9 || (!options_.until_s && level().at_rest);
}

/// Length of the next step: frames, and the end, are met exactly by equal steps.
double Run::slice() const {
  double end_s = now_.frames / options_.frames_per_second;
  if (options_.until_s) end_s = std::min(end_s, *options_.until_s);
  const double left_s = end_s - now_.state.time_s;
  return left_s / std::max(1.0, std::ceil(left_s / now_.pace.step_s - 1e-9));
}

bool Run::nearly_still() const {
  return !now_.rows.empty() && now_.rows.back().speed_m_s < 100.0 * options_.rest_speed_m_s;
}

/// Where rest is near, what is left of forces counts and not what they would still move, and must
/// not shake the cloth.
void Run::set_tolerances() {
  const bool last_steps = nearly_still();
  StepOptions& step = system_->options();
  step.motion_tolerance = last_steps ? 0.0 : options_.step.motion_tolerance;
  step.tolerance = last_steps ? 0.2 * options_.rest_residual : options_.step.tolerance;
}

void Run::advance() {
  const ClothState before = now_.state;
  set_tolerances();
  for (int halvings = 0;; ++halvings) {
    const double step_s = slice();
    StepReport report;
    system_->options().most_newton_iterations =
        options_.step.most_newton_iterations * (halvings < halvings_to_insist ? 1 : insistence);
    if (try_step(step_s, report)) {
      now_.shortest_step_s = std::min(now_.shortest_step_s, step_s);
      if (++now_.easy_steps >= easy_steps_to_grow) {
        now_.easy_steps = 0;
        now_.pace.step_s = std::min(options_.longest_step_s, 2.0 * now_.pace.step_s);
      }
      record(report, step_s);
      if (nearly_still()) now_.rows.back().residual = system_->rest_residual(now_.state);
      if (smallest_gap() < for_hits.small_gap) strengthen_contact(for_hits);
      break;
    }
    now_.state = before;
    system_->contacts().update(before.positions_m, before.time_s);
    ++now_.rejected_steps;
    if (!report.solved && halvings + 1 >= halvings_to_insist) strengthen_contact(for_hits);
    now_.easy_steps = 0;
    now_.pace.step_s = 0.5 * step_s;
    if (now_.pace.step_s < options_.smallest_step_s) {
      const bool explicitly = options_.step.scheme == TimeScheme::explicit_euler;
      throw SolverError(fmt::format(
          "{}: no step from {:.4f} s on could be solved, down to {:g} s; {} may help", setup_.name,
          before.time_s, options_.smallest_step_s,
          explicitly ? "shorter steps from the start (explicit ones have a limit of stability) or "
                       "the implicit scheme"
                     : "a wider spacing, a larger strain limit or a slower body"));
    }
    if (!said_short_ && now_.pace.step_s < 0.1 * options_.longest_step_s) {
      said_short_ = true;
      sink_.warn(fmt::format("steps of {:g} s are too long here: halved down to {:g} s at {:.3f} s",
                             options_.longest_step_s, now_.pace.step_s, before.time_s));
    }
  }
  if (now_.state.time_s >= now_.frames / options_.frames_per_second - 1e-9) write_frame();
}

/// Over its reach; 1 where nothing touches.
double Run::smallest_gap() {
  double smallest = 1.0;
  for (const Contact& contact : system_->contacts().contacts(now_.state.positions_m)) {
    smallest = std::min(smallest, contact.gap_m / contact.reach_m);
  }
  return smallest;
}

double Run::largest_elongation() {
  const std::vector<double> all = system_->energy().elongations(now_.state.positions_m);
  return all.empty() ? 0.0 : *std::max_element(all.begin(), all.end());
}

void Run::strengthen_contact(const Strengthening& how) {
  if (now_.barrier_factor >= largest_barrier_factor) return;
  now_.barrier_factor *= how.growth;
  system_->contact_law().barrier_pa *= how.growth;
}

bool Run::try_step(double step_s, StepReport& report) {
  report = system_->step(now_.state, step_s);
  if (!report.solved || !now_.state.positions_m.allFinite()) return false;
  const double largest = largest_elongation();
  if (largest > elongation_ + options_.strain_limit) return false;
  elongation_ = largest;
  return true;
}

// ---- rest alone

void Run::settle_level() {
  RestOptions rest = options_.rest;
  if (resumed_) rest.pace = now_.pace;
  if (!resumed_ && options_.method == SimulationMethod::quasistatic) write_frame();
  RestReport before;
  rest.after_step = [&](const ClothState&, const RestReport& report, const RestPace& pace) {
    const StepReport step{.newton_iterations = report.newton_iterations - before.newton_iterations,
                          .linear_iterations = report.linear_iterations - before.linear_iterations};
    before = report;
    const double step_s = now_.pace.step_s;
    now_.pace = pace;
    elongation_ = largest_elongation();
    record(step, step_s);
    now_.rows.back().residual = level().residual = report.residual;
    if (!report.at_rest && report.step_solved && smallest_gap() < for_rest.small_gap)
      strengthen_contact(for_rest);
    if (options_.method == SimulationMethod::quasistatic) write_frame();
    save_if_due();
  };
  const RestReport report = settle(*system_, now_.state, rest, progress_);
  level().at_rest = report.at_rest;
  stopped_ = !report.at_rest && progress_.cancelled();
  if (!report.at_rest && !stopped_)
    sink_.warn(
        fmt::format("level of {:g} m is not at rest after {} steps: {:.1e} of the weight is "
                    "not balanced",
                    level().spacing_m, report.steps, report.residual));
}

// ---- records

void Run::record(const StepReport& report, double step_s) {
  const ClothState& state = now_.state;
  const ClothEnergies energies = system_->energies(state);
  SimulationRow row;
  row.time_s = state.time_s;
  row.step_s = step_s;
  row.elastic_j = energies.elastic_j;
  row.gravity_j = energies.gravity_j;
  row.contact_j = energies.contact_j;
  if (dynamic()) {  // a quasi-static step has no velocity
    row.kinetic_j = energies.kinetic_j;
    row.speed_m_s = state.velocities_m_s.rowwise().norm().maxCoeff();
  }
  row.elongation = elongation_;
  row.newton_iterations = report.newton_iterations;
  row.linear_iterations = report.linear_iterations;
  row.level = level_index();
  row.contacts = static_cast<std::int32_t>(system_->contacts().contacts(state.positions_m).size());
  now_.rows.push_back(row);
  ++level().steps;
  level().newton_iterations += report.newton_iterations;
  level().linear_iterations += report.linear_iterations;
  note_strain(row.elongation);
}

void Run::note_strain(double elongation) {
  if (elongation <= options_.strain_limit || now_.over_strained_s) return;
  now_.over_strained_s = now_.state.time_s;
  sink_.warn(fmt::format("the cloth is stretched by {:.1f} %, more than the limit of {:.1f} %",
                         1e2 * elongation, 1e2 * options_.strain_limit));
}

void Run::write_frame() {
  sink_.frame(now_.frames, now_.state.time_s, system_->scene().sheet, now_.state.positions_m);
  ++now_.frames;
}

void Run::tick() {
  const double cpu_s = cpu_clock_s(), wall_s = wall_clock_s();
  const double contact_s = system_->timing().contact_s;
  level().cpu_s += cpu_s - cpu_s_;
  level().wall_s += wall_s - wall_s_;
  level().contact_s += contact_s - contact_s_;
  cpu_s_ = cpu_s, wall_s_ = wall_s, contact_s_ = contact_s;
}

void Run::save() {
  tick();
  sink_.checkpoint(now_);
  saved_s_ = wall_clock_s();
}

void Run::save_if_due() {
  if (wall_clock_s() - saved_s_ >= options_.checkpoint_interval_s) save();
}

SimulationSummary Run::summary() {
  SimulationSummary out;
  out.scene = system_->scene();
  out.at_rest = level().at_rest;
  out.stopped = stopped_;
  out.residual = level().residual = system_->rest_residual(now_.state);
  out.residual_n = out.residual * system_->weight_norm();
  const std::vector<double> all = system_->energy().elongations(now_.state.positions_m);
  for (const double e : all) {
    out.largest_elongation = std::max(out.largest_elongation, e);
    out.largest_compression = std::max(out.largest_compression, -e);
  }
  out.penetrations =
      static_cast<std::int64_t>(system_->contacts().penetrations(now_.state.positions_m).size());
  if (setup_.drape) {
    out.drape = measure_drape(out.scene.sheet, now_.state.positions_m, *setup_.drape);
  }
  out.rejected_steps = now_.rejected_steps;
  out.shortest_step_s = now_.shortest_step_s;
  out.barrier_factor = now_.barrier_factor;
  out.over_strained_s = now_.over_strained_s;
  out.frames = now_.frames;
  out.levels = std::move(now_.levels);
  out.rows = std::move(now_.rows);
  out.state = std::move(now_.state);
  return out;
}

}  // namespace

void SimulationSink::begin() {}
void SimulationSink::frame(int, double, const Sheet&, const Points&) {}
void SimulationSink::level_done(int, const SimulationLevel&, const Sheet&, const Points&) {}
void SimulationSink::checkpoint(const SimulationCheckpoint&) {}
void SimulationSink::warn(const std::string&) {}

std::uint64_t simulation_key(const ClothScene& scene, const SimulationOptions& options) {
  Key key;
  add_scene(key, scene);
  for (const double value :
       {static_cast<double>(options.method), options.spacing_m,
        static_cast<double>(options.step.scheme), options.step.linear_tolerance,
        options.step.tolerance, options.step.motion_tolerance,
        static_cast<double>(options.step.most_newton_iterations), options.longest_step_s,
        options.smallest_step_s, options.strain_limit, options.frames_per_second,
        options.rest.tolerance, options.rest.first_step_s, options.rest.longest_step_s,
        options.rest.linear_tolerance, options.rest.motion_tolerance,
        static_cast<double>(options.rest.most_newton_iterations), options.coarsest_spacing_m}) {
    key.add(value);
  }
  return key.sum();
}

SimulationSummary simulate(const SimulationSetup& setup, const SimulationOptions& options,
                           SimulationSink& sink, Progress& progress,
                           const SimulationCheckpoint* resume) {
  return Run(setup, options, sink, progress).run(resume);
}

}  // namespace semblance
