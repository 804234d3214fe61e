// Random trials: how much the comparison gains over pairs alone, and whether deviations are honest.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "object_scene.h"

namespace semblance::testing {
namespace {

constexpr int kTrials = 30;

double quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5)];
}

/// Errors of one kind of estimate over all trials.
struct Tally {
  std::vector<double> turn_deg, place_mm, focal_percent, z, z_focal;

  void add(const ObjectErrors& errors) {
    turn_deg.push_back(errors.turn_deg);
    place_mm.push_back(errors.place_mm);
    focal_percent.push_back(100.0 * std::abs(errors.focal_share));
    z.insert(z.end(), errors.z.begin(), errors.z.begin() + 6);
    if (errors.z.size() > 6) z_focal.push_back(errors.z[6]);
  }
  static double within(const std::vector<double>& z, double limit) {
    const auto count =
        std::count_if(z.begin(), z.end(), [&](double v) { return std::abs(v) < limit; });
    return static_cast<double>(count) / static_cast<double>(std::max<std::size_t>(z.size(), 1));
  }
  void print(const char* name) const {
    fmt::print(
        "{:8} turn {:.3f} / {:.3f} deg, place {:.2f} / {:.2f} mm, focal {:.2f} / {:.2f} % "
        "(median / 90 %); within 1 sigma {:.0f} %, 1.96 sigma {:.0f} % (focal {:.0f}, {:.0f} "
        "of {})\n",
        name, quantile(turn_deg, 0.5), quantile(turn_deg, 0.9), quantile(place_mm, 0.5),
        quantile(place_mm, 0.9), quantile(focal_percent, 0.5), quantile(focal_percent, 0.9),
        100.0 * within(z, 1.0), 100.0 * within(z, 1.96), 100.0 * within(z_focal, 1.0),
        100.0 * within(z_focal, 1.96), z_focal.size());
  }
};

struct Outcome {
  Tally pairs, refined;
  int failures = 0;
  double seconds = 0.0;
};

Outcome run_trials(const ObjectScene& scene, bool known_camera, int pictures) {
  const ObjectTarget target = make_object_target(scene.mesh(), scene.texture(), "lump");
  Outcome out;
  for (int trial = 0; trial < kTrials; ++trial) {
    Random random(1000 + static_cast<std::uint64_t>(trial));
    const Camera camera = test_camera(random.uniform(500.0, 1100.0));
    std::vector<ObjectPicture> seen;
    std::vector<Rigid3> truth;
    for (int k = 0; k < pictures; ++k) {
      truth.push_back(random_pose(camera, 0.24, random.uniform(0.5, 0.75), random));
      seen.push_back(scene.picture(camera, truth.back(),
                                   static_cast<std::uint64_t>(pictures * trial + k + 1)));
    }
    ObjectOptions options;
    if (known_camera) options.camera = camera;
    try {
      const ObjectCalibration found = calibrate_object(target, seen, options);
      out.seconds += found.solve_s / pictures;
      const ObjectErrors before = errors_of(found.from_pairs, 0, truth[0], camera),
                         after = errors_of(*found.refined, 0, truth[0], camera);
      out.pairs.add(before);
      out.refined.add(after);
      if (std::getenv("SEMBLANCE_VERBOSE") != nullptr) {
        fmt::print(
            "{:2}: turn {:.2f} -> {:.3f} deg, place {:.1f} -> {:.2f} mm, focal {:+.1f} -> "
            "{:+.2f} %; pairs {:.1f} -> {:.1f} ({:.1f}) px; outline {:.2f} px {:.0f} %, colours "
            "{:.4f} {:.3f}, {} rounds {:.2f} s; z",
            trial, before.turn_deg, after.turn_deg, before.place_mm, after.place_mm,
            100 * before.focal_share, 100 * after.focal_share, found.from_pairs.pairs_rms_px,
            found.refined->pairs_rms_px, found.refined->pair_sigma_px, found.fits[0].outline_rms_px,
            100 * found.fits[0].outline_share, found.fits[0].colour_rms,
            found.fits[0].colour_correlation, found.rounds, found.solve_s);
        for (const double z : after.z) fmt::print(" {:.1f}", z);
        fmt::print("\n");
      }
    } catch (const std::exception& error) {
      ++out.failures;
      fmt::print("{:2}: {}\n", trial, error.what());
    }
  }
  out.pairs.print("pairs");
  out.refined.print("refined");
  fmt::print("{} of {} trials failed; {:.2f} s per picture\n", out.failures, kTrials,
             out.seconds / kTrials);
  return out;
}

const ObjectSceneOptions kPlain{.textured = false};

ObjectScene textured() { return {lump_mesh(), blotted_texture(512, 300, 0.06, 5), {}}; }

/// The focal length is one figure a trial: of 30, 26 within 1.96 deviations are usual.
void expect_honest_focal(const Tally& tally) { EXPECT_GT(Tally::within(tally.z_focal, 1.96), 0.8); }

/// Shares of the figures whose error is within one deviation, and within 1.96 of them.
void expect_honest(const Tally& tally, double within_one, double within_two) {
  EXPECT_GT(Tally::within(tally.z, 1.0), within_one);
  EXPECT_GT(Tally::within(tally.z, 1.96), within_two);
}

TEST(ObjectTrials, TextureKnownCamera) {
  const Outcome outcome = run_trials(textured(), true, 1);
  EXPECT_LE(outcome.failures, 2);
  EXPECT_LT(quantile(outcome.refined.turn_deg, 0.9), 0.1);
  EXPECT_LT(quantile(outcome.refined.turn_deg, 0.5), 0.05 * quantile(outcome.pairs.turn_deg, 0.5));
  expect_honest(outcome.refined, 0.65, 0.9);
}

TEST(ObjectTrials, TextureFocalSought) {
  const Outcome outcome = run_trials(textured(), false, 1);
  EXPECT_LE(outcome.failures, 2);
  EXPECT_LT(quantile(outcome.refined.turn_deg, 0.9), 0.15);
  EXPECT_LT(quantile(outcome.refined.focal_percent, 0.9), 1.0);
  expect_honest(outcome.refined, 0.65, 0.9);
  expect_honest_focal(outcome.refined);
}

TEST(ObjectTrials, OutlineKnownCamera) {
  const Outcome outcome = run_trials(ObjectScene(lump_mesh(), Image(), kPlain), true, 1);
  EXPECT_LE(outcome.failures, 3);
  EXPECT_LT(quantile(outcome.refined.turn_deg, 0.5), 0.3 * quantile(outcome.pairs.turn_deg, 0.5));
  EXPECT_LT(quantile(outcome.refined.place_mm, 0.5), 0.3 * quantile(outcome.pairs.place_mm, 0.5));
  expect_honest(outcome.refined, 0.5, 0.85);
}

TEST(ObjectTrials, MaskFocalSoughtThreePictures) {
  const Outcome outcome =
      run_trials(ObjectScene(lump_mesh(), Image(), {.textured = false, .mask = true}), false, 3);
  EXPECT_LE(outcome.failures, 3);
  EXPECT_LT(quantile(outcome.refined.focal_percent, 0.5), 1.5);
  EXPECT_LT(quantile(outcome.refined.turn_deg, 0.5), 0.2 * quantile(outcome.pairs.turn_deg, 0.5));
  expect_honest(outcome.refined, 0.5, 0.85);
  expect_honest_focal(outcome.refined);
}

}  // namespace
}  // namespace semblance::testing
