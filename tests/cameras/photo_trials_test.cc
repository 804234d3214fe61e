// The loop and the joint adjustment from a hundred starts that are 20 degrees and 30 % of the focal
// length off: marks of a drape, projected; marks of a head, found in painted photos.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "marker_scene.h"
#include "photo_survey.h"
#include "semblance/cameras/photo_calibration.h"

namespace semblance::testing {
namespace {

constexpr int kTrials = 100;

double middle(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + std::ssize(values) / 2, values.end());
  return values[values.size() / 2];
}

/// What both ways made of many starts.
class Tally {
 public:
  explicit Tally(double good_shape_m) : good_shape_m_(good_shape_m) {}

  void add(int trial, const Survey& truth, const Survey& start) {
    const PhotoCalibration loop = calibrate_by_loop(start, {}),
                           joint = calibrate_jointly(start, {});
    EXPECT_TRUE(loop.converged) << trial;
    EXPECT_TRUE(joint.converged) << trial;
    EXPECT_LT(shape_error_m(loop.survey, truth), good_shape_m_) << trial;
    EXPECT_LT(shape_error_m(joint.survey, truth), good_shape_m_) << trial;
    // The loop keeps every sighting, and so does what it is compared with.
    EXPECT_LT(loop.rms_px, 1.02 * joint.adjustment->rms_all_px + 0.005) << trial;
    loop_rounds_.push_back(loop.rounds);
    loop_s_.push_back(loop.solve_s);
    joint_rounds_.push_back(joint.rounds);
    joint_s_.push_back(joint.solve_s);
    shape_m_.push_back(shape_error_m(joint.survey, truth));
    focal_.push_back(
        std::abs(joint.survey.cameras[0].focal_px.x() / truth.cameras[0].focal_px.x() - 1.0));
  }
  void print(const char* name) const {
    std::printf(
        "%s, medians of %zu: loop %.0f rounds %.3f s, joint %.0f iterations %.3f s; shape "
        "%.3f mm, focal length %.3f %%\n",
        name, loop_rounds_.size(), middle(loop_rounds_), middle(loop_s_), middle(joint_rounds_),
        middle(joint_s_), 1e3 * middle(shape_m_), 100.0 * middle(focal_));
  }

 private:
  double good_shape_m_;
  std::vector<double> loop_rounds_, loop_s_, joint_rounds_, joint_s_, shape_m_, focal_;
};

TEST(PhotoTrials, Drape) {
  Tally tally(1.5e-3);
  for (int trial = 0; trial < kTrials; ++trial) {
    Random random(static_cast<std::uint64_t>(100 + trial));
    const Survey truth = draped_marks(random);
    tally.add(trial, truth, far_start(truth, random, trial % 2 == 1, 0.05));
  }
  tally.print("drape");
}

/// The survey without points that fewer photos show.
Survey with_points_seen(const Survey& all, int fewest) {
  std::vector<int> seen(all.points_m.size(), 0);
  for (const Sighting& sighting : all.sightings) ++seen[static_cast<std::size_t>(sighting.point)];
  Survey out = all;
  out.points_m.clear();
  out.sightings.clear();
  std::vector<int> index(all.points_m.size(), -1);
  for (std::size_t k = 0; k < all.points_m.size(); ++k) {
    if (seen[k] < fewest) continue;
    index[k] = static_cast<int>(out.points_m.size());
    out.points_m.push_back(all.points_m[k]);
  }
  for (Sighting sighting : all.sightings) {
    sighting.point = index[static_cast<std::size_t>(sighting.point)];
    if (sighting.point >= 0) out.sightings.push_back(sighting);
  }
  return out;
}

/// 25 dots on the front of a head, found in six photos of it from its front.
Survey photographed_head(std::uint64_t seed) {
  Random random(seed);
  Scene scene;
  for (const Disc& disc : dotted_head(random, 70, 0.022).discs) {
    if (disc.normal.z() > 0.3 && scene.object.discs.size() < 25) scene.object.discs.push_back(disc);
  }
  scene.camera = scene_camera(random, Lens::pinhole);
  Survey truth;
  truth.cameras = {scene.camera};
  for (const Disc& disc : scene.object.discs) truth.points_m.push_back(disc.centre_m);
  constexpr int photos = 6;
  for (int i = 0; i < photos; ++i) {
    const double z = scene.camera.focal_px.x() / 640.0 * 0.33;
    const Rigid3 pose = view_of({0.25 * random.normal(), -0.6 + 1.2 * i / (photos - 1), 0.0},
                                {0.01 * random.normal(), 0.01 * random.normal(), z});
    add_picture(scene, pose, false, {}, 50 * seed + static_cast<std::uint64_t>(i));
    truth.world_from_target.push_back(pose);
    for (int k = 0; k < std::ssize(scene.pictures.back().dots); ++k) {
      const int disc = scene.disc_of(i, k);
      if (disc < 0) continue;
      const Dot& dot = scene.pictures.back().dots[static_cast<std::size_t>(k)];
      truth.sightings.push_back(
          {.camera = 0, .placement = i, .point = disc, .pixel_px = dot.centre_px});
    }
  }
  return with_points_seen(truth, 3);
}

TEST(PhotoTrials, HeadWithMarksFoundInPictures) {
  Tally tally(1e-3);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Survey truth = photographed_head(static_cast<std::uint64_t>(200 + trial));
    Random random(static_cast<std::uint64_t>(900 + trial));
    tally.add(trial, truth, far_start(truth, random, trial % 2 == 1, 0.01));
  }
  tally.print("head");
}

}  // namespace
}  // namespace semblance::testing
