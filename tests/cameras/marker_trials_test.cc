// Random scenes: how good cameras from dots are, and whether their deviations are honest.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <map>

#include "marker_scene.h"

namespace semblance::testing {
namespace {

/// Errors of the focal length over many scenes, in their deviations and in px.
struct Tally {
  int count = 0;
  double squares = 0.0, worst = 0.0, error_px = 0.0;

  void add(const Scene& scene, const MarkerCalibration& found) {
    const double error =
        found.adjustment.survey.cameras[0].focal_px.x() - scene.camera.focal_px.x();
    const double normalised = error / focal_sigma(found);
    ++count;
    squares += normalised * normalised;
    worst = std::max(worst, std::abs(normalised));
    error_px += error * error;
  }
  /// For n errors of variance 1 the mean square is 1 +- sqrt(2 / n).
  void expect_honest(const char* name) const {
    const double variance = squares / count;
    std::printf(
        "%s: variance of normalised focal errors %.2f over %d scenes, worst %.1f, %.3f px "
        "rms\n",
        name, variance, count, worst, std::sqrt(error_px / count));
    EXPECT_GT(variance, 0.4) << name;
    EXPECT_LT(variance, 2.0) << name;
    EXPECT_LT(worst, 4.5) << name;
  }
};

TEST(MarkerTrials, KnownPlaces) {
  constexpr int scenes = 40;
  Tally with_faces, without;
  for (std::uint64_t seed = 100; seed < 100 + scenes; ++seed) {
    const Scene scene = photos(seed);
    for (const bool faces_known : {true, false}) {
      const MarkerCalibration found =
          calibrate_known_markers(scene.pictures, {"camera"}, scene.object.points(faces_known), {});
      EXPECT_EQ(wrong_names(scene, found), 0) << seed;
      (faces_known ? with_faces : without).add(scene, found);
    }
  }
  with_faces.expect_honest("known places and faces");
  without.expect_honest("known places");
}

/// Points that show more than one of the discs.
int mixed_points(const Scene& scene, const MarkerCalibration& found) {
  std::map<int, std::map<int, int>> discs_of_point;
  for (std::size_t i = 0; i < found.adjustment.survey.sightings.size(); ++i) {
    ++discs_of_point[found.adjustment.survey.sightings[i].point]
                    [scene.disc_of(found.picture_of_sighting[i], found.dot_of_sighting[i])];
  }
  int mixed = 0;
  for (const auto& [point, discs] : discs_of_point) mixed += discs.size() > 1;
  return mixed;
}

TEST(MarkerTrials, UnknownPlaces) {
  constexpr int scenes = 40;
  Tally tally;
  for (std::uint64_t seed = 100; seed < 100 + scenes; ++seed) {
    const Scene scene = clip(seed);
    const MarkerCalibration found = calibrate_unknown_markers(scene.pictures, "camera", {});
    EXPECT_EQ(mixed_points(scene, found), 0) << seed;
    tally.add(scene, found);
  }
  tally.expect_honest("unknown places");
}

}  // namespace
}  // namespace semblance::testing
