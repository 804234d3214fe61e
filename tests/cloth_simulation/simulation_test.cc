// Runs of cloth from start to end, on coarse sheets.
#include "semblance/cloth/simulation.h"

#include <gmock/gmock.h>

#include "plausible_fabric.h"
#include "semblance/cloth/checkpoint.h"
#include "semblance/cloth/presets.h"
#include "semblance/core/errors.h"

namespace semblance::testing {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::ThrowsMessage;

/// Keeps what a run hands out.
struct Notes : SimulationSink {
  std::vector<double> frame_times_s;
  std::vector<std::string> checkpoints, warnings;
  int levels_done = 0, first_frame = 0;

  void frame(int number, double time_s, const Sheet&, const Points&) override {
    EXPECT_EQ(number, first_frame + static_cast<int>(frame_times_s.size()));
    frame_times_s.push_back(time_s);
  }
  void level_done(int, const SimulationLevel&, const Sheet&, const Points&) override {
    ++levels_done;
  }
  void checkpoint(const SimulationCheckpoint& checkpoint) override {
    checkpoints.push_back(format_checkpoint(checkpoint));
  }
  void warn(const std::string& message) override { warnings.push_back(message); }
};

/// Stops a run after so many looks.
struct Impatient : Progress {
  explicit Impatient(int patience) : left(patience) {}
  void begin(const std::string&, std::int64_t) override {}
  void update(std::int64_t) override {}
  void end() override {}
  bool cancelled() const override { return --left < 0; }
  mutable int left;
};

SimulationOptions some_options(SimulationMethod method, double spacing_m) {
  SimulationOptions options;
  options.method = method;
  options.spacing_m = spacing_m;
  return options;
}

TEST(Simulation, AStripComesToRestByEveryMethod) {
  const SimulationSetup setup = preset_setup("strip", plausible_fabric());
  std::vector<double> tip_m;
  for (const auto method : {SimulationMethod::dynamic, SimulationMethod::quasistatic,
                            SimulationMethod::coarse_to_fine}) {
    Notes notes;
    const SimulationSummary summary =
        simulate(setup, some_options(method, method == SimulationMethod::dynamic ? 0.01 : 0.005),
                 notes, silent_progress());
    EXPECT_TRUE(summary.at_rest);
    EXPECT_LT(summary.residual, 1e-3);
    EXPECT_GT(summary.residual_n, 0.0);
    EXPECT_EQ(summary.penetrations, 0);
    EXPECT_EQ(summary.rows.empty(), false);
    tip_m.push_back(summary.state.positions_m.col(1).minCoeff());
  }
  EXPECT_LT(tip_m[0], -0.02);
  EXPECT_NEAR(tip_m[1], tip_m[0], 0.02);
}

TEST(Simulation, FramesComeAtTheirTimes) {
  const SimulationSetup setup = preset_setup("pinned", plausible_fabric());
  SimulationOptions options = some_options(SimulationMethod::dynamic, 0.1);
  options.until_s = 0.2;
  options.frames_per_second = 30.0;
  options.longest_step_s = 0.013;
  Notes notes;
  const SimulationSummary summary = simulate(setup, options, notes, silent_progress());
  ASSERT_EQ(notes.frame_times_s.size(), 7u);
  for (int k = 0; k < 7; ++k) EXPECT_NEAR(notes.frame_times_s[k], k / 30.0, 1e-9);
  EXPECT_NEAR(summary.state.time_s, 0.2, 1e-9);
  EXPECT_FALSE(summary.at_rest);
}

/// Falling without hold, a sheet's kinetic energy and work of gravity balance but for drag.
TEST(Simulation, EnergiesBalanceInFreeFall) {
  SimulationSetup setup = preset_setup("pinned", plausible_fabric());
  setup.make = [make = setup.make](double spacing_m) {
    ClothScene scene = make(spacing_m);
    scene.fixed.clear();
    scene.fabric.mass_damping_1_s = 0.0;
    return scene;
  };
  SimulationOptions options = some_options(SimulationMethod::dynamic, 0.1);
  options.until_s = 0.1;
  options.longest_step_s = 1e-3;
  options.step.tolerance = 1e-6;
  Notes notes;
  const SimulationSummary summary = simulate(setup, options, notes, silent_progress());
  const SimulationRow& first = summary.rows.front();
  const SimulationRow& last = summary.rows.back();
  EXPECT_NEAR(last.speed_m_s, 0.980665, 1e-3);
  EXPECT_NEAR(last.kinetic_j + last.gravity_j, first.kinetic_j + first.gravity_j,
              0.03 * last.kinetic_j);
  EXPECT_NEAR(last.elastic_j, 0.0, 1e-9);
}

void expect_resumed_alike(const SimulationSetup& setup, const SimulationOptions& options,
                          int patience) {
  Notes whole_notes, notes, later;
  const SimulationSummary whole = simulate(setup, options, whole_notes, silent_progress());
  Impatient impatient(patience);
  const SimulationSummary stopped = simulate(setup, options, notes, impatient);
  ASSERT_TRUE(stopped.stopped);
  ASSERT_FALSE(notes.checkpoints.empty());
  const SimulationCheckpoint checkpoint = parse_checkpoint(notes.checkpoints.back(), "test");
  later.first_frame = checkpoint.frames;
  const SimulationSummary resumed = simulate(setup, options, later, silent_progress(), &checkpoint);
  EXPECT_EQ(resumed.state.positions_m, whole.state.positions_m);
  EXPECT_EQ(resumed.rows.size(), whole.rows.size());
  EXPECT_EQ(resumed.frames, whole.frames);
  EXPECT_LT(stopped.rows.size(), whole.rows.size());
}

TEST(Simulation, ResumesToTheSameBytes) {
  const SimulationSetup setup = preset_setup("table", plausible_fabric());
  SimulationOptions options = some_options(SimulationMethod::dynamic, 0.08);
  options.until_s = 0.4;
  expect_resumed_alike(setup, options, 15);
  options.step.scheme = TimeScheme::bdf2;
  expect_resumed_alike(setup, options, 15);
}

TEST(Simulation, RestIsResumedToTheSameBytes) {
  const SimulationSetup setup = preset_setup("strip", plausible_fabric());
  expect_resumed_alike(setup, some_options(SimulationMethod::quasistatic, 0.01), 4);
  SimulationOptions options = some_options(SimulationMethod::coarse_to_fine, 0.005);
  Notes notes;
  const auto whole = simulate(setup, options, notes, silent_progress());
  ASSERT_EQ(whole.levels.size(), 2u);
  // Once in each level.
  expect_resumed_alike(setup, options, whole.levels[0].steps / 2);
  expect_resumed_alike(setup, options, whole.levels[0].steps + whole.levels[1].steps / 2);
}

TEST(Simulation, ResumesNoOtherRun) {
  const SimulationSetup setup = preset_setup("strip", plausible_fabric());
  SimulationOptions options = some_options(SimulationMethod::dynamic, 0.01);
  options.until_s = 0.2;
  Notes notes;
  Impatient impatient(5);
  simulate(setup, options, notes, impatient);
  const SimulationCheckpoint checkpoint = parse_checkpoint(notes.checkpoints.back(), "test");
  options.strain_limit = 0.02;
  EXPECT_THAT([&] { simulate(setup, options, notes, silent_progress(), &checkpoint); },
              ThrowsMessage<InvalidInput>(HasSubstr("other options")));
}

TEST(Simulation, RefusesABodyInTheSheet) {
  SimulationSetup setup = preset_setup("table", plausible_fabric());
  setup.make = [make = setup.make](double spacing_m) {
    ClothScene scene = make(spacing_m);
    scene.start_m.col(1).array() -= 0.01;
    return scene;
  };
  Notes notes;
  EXPECT_THAT(
      [&] {
        simulate(setup, some_options(SimulationMethod::dynamic, 0.1), notes, silent_progress());
      },
      ThrowsMessage<InvalidInput>(AllOf(HasSubstr("cannot start"), HasSubstr("table"))));
  EXPECT_THAT(notes.frame_times_s, IsEmpty());
}

TEST(Simulation, RefusesOptionsThatDoNotFit) {
  const SimulationSetup setup = preset_setup("table", plausible_fabric());
  SimulationOptions options = some_options(SimulationMethod::quasistatic, 0.1);
  options.until_s = 1.0;
  Notes notes;
  const auto run = [&] { simulate(setup, options, notes, silent_progress()); };
  EXPECT_THAT(run, ThrowsMessage<InvalidInput>(HasSubstr("know no time")));
  options.method = SimulationMethod::dynamic;
  options.longest_step_s = -1.0;
  EXPECT_THAT(run, ThrowsMessage<InvalidInput>(HasSubstr("longest step")));
}

/// Neighbouring spacings come by the same coarse shapes, as far as those are coarser.
TEST(Simulation, SheetsOfAnySpacingComeByTheSameLevels) {
  const SimulationSetup setup = preset_setup("table", plausible_fabric());
  std::vector<SimulationSummary> runs;
  for (const double spacing_m : {0.05, 0.07}) {
    SimulationOptions options = some_options(SimulationMethod::coarse_to_fine, spacing_m);
    options.coarsest_spacing_m = 0.2;
    Notes notes;
    runs.push_back(simulate(setup, options, notes, silent_progress()));
  }
  ASSERT_EQ(runs[0].levels.size(), 3u);
  ASSERT_EQ(runs[1].levels.size(), 3u);
  for (const int level : {0, 1}) {
    EXPECT_EQ(runs[0].levels[level].spacing_m, level == 0 ? 0.2 : 0.1);
    EXPECT_EQ(runs[0].levels[level].spacing_m, runs[1].levels[level].spacing_m);
    EXPECT_EQ(runs[0].levels[level].residual, runs[1].levels[level].residual);
  }
}

TEST(Simulation, SaysWhichLevelIsNotAtRest) {
  const SimulationSetup setup = preset_setup("table", plausible_fabric());
  SimulationOptions options = some_options(SimulationMethod::coarse_to_fine, 0.05);
  options.coarsest_spacing_m = 0.1;
  options.rest.most_steps = 1;
  Notes notes;
  const SimulationSummary summary = simulate(setup, options, notes, silent_progress());
  EXPECT_FALSE(summary.at_rest);
  for (const char* level : {"level of 0.1 m is not at rest", "level of 0.05 m is not at rest"})
    EXPECT_THAT(notes.warnings, Contains(HasSubstr(level)));
}

/// A step of half a second is shortened until the strain behaves.
TEST(Simulation, StepsThatAreTooLongAreHalved) {
  const SimulationSetup setup = preset_setup("pinned", plausible_fabric());
  SimulationOptions options = some_options(SimulationMethod::dynamic, 0.1);
  options.until_s = 0.5;
  options.frames_per_second = 2.0;
  options.longest_step_s = 0.5;
  options.strain_limit = 1e-3;
  Notes notes;
  const SimulationSummary summary = simulate(setup, options, notes, silent_progress());
  EXPECT_GT(summary.rejected_steps, 0);
  EXPECT_LT(summary.shortest_step_s, 0.1);
  EXPECT_THAT(notes.warnings, Contains(HasSubstr("are too long here")));
  for (std::size_t k = 1; k < summary.rows.size(); ++k) {
    EXPECT_LE(summary.rows[k].elongation, summary.rows[k - 1].elongation + 1e-3);
  }
}

/// A body of a file in centimetres that was taken for one in metres.
TEST(Simulation, BodiesWithEdgesBelowTheThicknessAreNamed) {
  Mesh corner;
  corner.positions_m.resize(4, 3);
  corner.positions_m << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  corner.positions_m.rowwise() -= Eigen::RowVector3d(0, 50, 0);
  corner.triangles.resize(4, 3);
  corner.triangles << 0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3;
  for (const double scale : {1.0, 1e-5}) {
    Mesh body = corner;
    body.positions_m *= scale;
    if (scale < 1.0) body.positions_m.rowwise() -= Eigen::RowVector3d(0, 50, 0);
    SimulationSetup setup = preset_setup("pinned", plausible_fabric());
    setup.make = [make = setup.make, body](double spacing_m) {
      ClothScene scene = make(spacing_m);
      scene.obstacles.push_back(make_mesh_obstacle("doll", body));
      return scene;
    };
    SimulationOptions options = some_options(SimulationMethod::dynamic, 0.1);
    options.until_s = 0.01;
    Notes notes;
    simulate(setup, options, notes, silent_progress());
    const auto named = Contains(AllOf(HasSubstr("doll"), HasSubstr("is its scale right?")));
    if (scale < 1.0) {
      EXPECT_THAT(notes.warnings, named);
    } else {
      EXPECT_THAT(notes.warnings, Not(named));
    }
  }
}

/// Falling onto a box at 2 m/s and more, some 20 cm wide meshes at a time.
TEST(Simulation, AHitAtSpeedIsSurvived) {
  const SimulationSetup setup = preset_setup("pinned-box", plausible_fabric());
  SimulationOptions options = some_options(SimulationMethod::dynamic, 0.1);
  options.until_s = 0.5;
  options.longest_step_s = 0.02;
  Notes notes;
  const SimulationSummary summary = simulate(setup, options, notes, silent_progress());
  EXPECT_EQ(summary.penetrations, 0);
  EXPECT_GT(summary.rows.back().contacts, 0);
}

/// What steps add to the energy of a sheet that swings against a box, J in all. Fixed supports do
/// no work and bodies stand still, so every step can only lose energy: by friction between yarns
/// and on surfaces, viscosity, drag, and what implicit steps lose by themselves. Only where contact
/// is strengthened, four times at once, does what it holds grow with it.
double energy_gained_j(double spacing_m, double longest_step_s, double until_s) {
  SimulationOptions options = some_options(SimulationMethod::dynamic, spacing_m);
  options.until_s = until_s;
  options.longest_step_s = longest_step_s;
  Notes notes;
  const SimulationSummary summary =
      simulate(preset_setup("pinned-box", plausible_fabric()), options, notes, silent_progress());
  const auto energy_j = [](const SimulationRow& row) {
    return row.kinetic_j + row.elastic_j + row.gravity_j + row.contact_j;
  };
  std::int32_t contacts = 0;
  double gained_j = 0.0;
  for (std::size_t k = 1; k < summary.rows.size(); ++k) {
    const SimulationRow &before = summary.rows[k - 1], &now = summary.rows[k];
    const double rise_j = energy_j(now) - energy_j(before);
    EXPECT_LE(rise_j, 3.0 * before.contact_j + 1e-9) << now.time_s;
    gained_j += std::max(0.0, rise_j);
    contacts = std::max(contacts, now.contacts);
  }
  EXPECT_GT(contacts, 20);
  EXPECT_GT(summary.barrier_factor, 1.0);
  EXPECT_LT(energy_j(summary.rows.back()), -0.5);  // the rest of what there was at first, 0
  return gained_j;
}

/// Steps of 2 ms lose little by themselves and show the strengthening: once, 5e-4 J of 0.5 J. The
/// usual ones show none.
TEST(Simulation, EnergyDoesNotRise) {
  EXPECT_LT(energy_gained_j(0.05, 0.01, 1.5), 1e-9);
  EXPECT_LT(energy_gained_j(0.1, 0.002, 1.0), 1e-3);
}

/// A ball that rises under a pinned sheet carries it.
TEST(Simulation, MovingBodiesPushTheSheet) {
  SimulationSetup setup = preset_setup("pinned", plausible_fabric());
  setup.make = [make = setup.make](double spacing_m) {
    ClothScene scene = make(spacing_m);
    scene.self_contact = false;
    Obstacle ball = make_sphere("ball", 0.1);
    ball.world_from_body = [](double time_s) {
      Rigid3 place;
      place.translation_m = {0.0, -0.11 + 0.4 * time_s, 0.2};
      return place;
    };
    scene.obstacles = {ball};
    return scene;
  };
  SimulationOptions options = some_options(SimulationMethod::dynamic, 0.2);
  Notes notes;
  EXPECT_THAT([&] { simulate(setup, options, notes, silent_progress()); },
              ThrowsMessage<InvalidInput>(HasSubstr("a body moves")));
  options.until_s = 0.08;
  const SimulationSummary summary = simulate(setup, options, notes, silent_progress());
  EXPECT_EQ(summary.penetrations, 0);
  EXPECT_GT(summary.state.positions_m.col(1).maxCoeff(), 0.015);
}

}  // namespace
}  // namespace semblance::testing
