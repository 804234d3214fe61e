#include "semblance/synth/generate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"
#include "semblance/io/camera_io.h"
#include "semblance/io/lip_markers.h"
#include "semblance/io/track_file.h"
#include "semblance/io/video.h"
#include "semblance/models/face.h"
#include "semblance/render/visibility.h"
#include "semblance/synth/motion.h"
#include "support.h"

namespace semblance {
namespace {

FaceClipSpec small_spec() {
  FaceClipSpec spec;
  spec.density = 0.6;
  spec.frames = 6;
  spec.frames_per_second = 2;
  spec.width = 160;
  spec.height = 120;
  spec.focal_px = 150;
  spec.sensor.samples = 1;
  return spec;
}

std::string contents(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(GenerateTest, LandmarksOfTheTruthLieWhereTheMeshIsSeen) {
  testing::TemporaryFolder folder;
  FaceClipSpec spec = small_spec();
  spec.width = 640, spec.height = 480, spec.focal_px = 600;
  const ClipFiles files = generate_clip(spec, (folder.path() / "clip").string());
  const Track truth = read_track(files.truth);
  const Camera camera = read_camera(files.camera);
  ASSERT_EQ(truth.frames.size(), 6u);
  // The rasteriser stands for the mesh: an engine that synthesis does not use.
  const MorphModel model(make_sweep_face({spec.density}));
  Rasteriser rasteriser;
  int looked = 0, close = 0;
  for (const TrackFrame& frame : truth.frames) {
    Scene scene;
    model.synthesize(frame.x, scene);
    VisiblePixels pixels;
    rasteriser.visible_pixels(scene, camera, nullptr, pixels);
    const auto projected = rasteriser.projected_vertices();
    std::vector<int> triangle_at(static_cast<std::size_t>(camera.width) * camera.height, -1);
    for (std::size_t i = 0; i < pixels.size(); ++i)
      triangle_at[pixels.pixel[i]] = pixels.triangle[i];
    for (int k = 17; k < 68; ++k) {
      if (frame.extra["landmarks_visible"][k] != 1) continue;
      const Eigen::Vector2d p = frame.landmarks_px[k];
      ++looked;
      // In the 3x3 pixels around, a triangle is seen that has a corner within a few pixels.
      double nearest = 1e9;
      for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) {
          const int x = std::clamp(static_cast<int>(p.x()) + i, 0, camera.width - 1);
          const int y = std::clamp(static_cast<int>(p.y()) + j, 0, camera.height - 1);
          const int seen = triangle_at[y * camera.width + x];
          for (int c = 0; seen >= 0 && c < 3; ++c) {
            const int vertex = scene.objects[0].mesh->triangles(seen, c);
            nearest = std::min(nearest, std::hypot(projected[3 * vertex] - p.x(),
                                                   projected[3 * vertex + 1] - p.y()));
          }
        }
      close += nearest < 12 ? 1 : 0;
    }
  }
  EXPECT_GT(looked, 200);
  EXPECT_GE(close, looked - looked / 100);
}

TEST(GenerateTest, SameBytesForAnyNumberOfThreads) {
  testing::TemporaryFolder folder;
  const FaceClipSpec spec = small_spec();
  set_thread_count(1);
  const ClipFiles one = generate_clip(spec, (folder.path() / "one").string());
  set_thread_count(3);
  const ClipFiles three = generate_clip(spec, (folder.path() / "three").string());
  set_thread_count(0);
  EXPECT_EQ(contents(one.truth), contents(three.truth));
  for (int i = 0; i < spec.frames; ++i) {
    std::string name = "/00000x.png";
    name[6] = static_cast<char>('0' + i);
    EXPECT_EQ(contents(one.video + name), contents(three.video + name)) << name;
    EXPECT_FALSE(contents(one.video + name).empty());
  }
}

TEST(GenerateTest, VideoHasTheFramesOfTheTruth) {
  testing::TemporaryFolder folder;
  FaceClipSpec spec = small_spec();
  spec.output = "avi";
  const ClipFiles files = generate_clip(spec, (folder.path() / "clip").string());
  VideoSource video(files.video);
  Rgb8 picture;
  int count = 0;
  while (video.next(picture)) ++count;
  EXPECT_EQ(count, spec.frames);
  EXPECT_EQ(picture.width, spec.width);
}

TEST(GenerateTest, HandHidesTheMouth) {
  testing::TemporaryFolder folder;
  FaceClipSpec spec = small_spec();
  spec.width = 480, spec.height = 360, spec.focal_px = 450;
  spec.occlusion.hand_from_s = 0.9;
  spec.occlusion.hand_to_s = 1.6;  // frames 2 and 3, at 1.0 and 1.5 s
  const Track truth = read_track(generate_clip(spec, (folder.path() / "clip").string()).truth);
  const auto seen = [&](int frame, int first, int last) {
    int count = 0;
    for (int k = first; k <= last; ++k)
      count += truth.frames[frame].extra["landmarks_visible"][k].get<int>();
    return count;
  };
  EXPECT_GE(seen(0, 48, 67), 18);
  EXPECT_LE(seen(2, 48, 67), 6);
  EXPECT_GE(seen(2, 36, 47), 8);  // the eyes stay free
}

TEST(GenerateTest, HeadLeavesThePicture) {
  testing::TemporaryFolder folder;
  FaceClipSpec spec = small_spec();
  spec.frames = 8;
  spec.occlusion.leave_from_s = 1.4;
  spec.occlusion.leave_to_s = 2.2;
  const Track truth = read_track(generate_clip(spec, (folder.path() / "clip").string()).truth);
  EXPECT_TRUE(truth.frames[0].extra["in_picture"].get<bool>());
  EXPECT_FALSE(truth.frames[3].extra["in_picture"].get<bool>());
  EXPECT_FALSE(truth.frames[4].extra["in_picture"].get<bool>());
  EXPECT_TRUE(truth.frames[7].extra["in_picture"].get<bool>());
}

TEST(GenerateTest, OtherContentIsNotOverwritten) {
  testing::TemporaryFolder folder;
  std::ofstream(folder.path() / "thesis.tex") << "important";
  EXPECT_THROW(generate_clip(small_spec(), folder.path().string()), InvalidInput);
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "thesis.tex"));
}

TEST(MotionTest, ReachesTheStatedYawWithinTheStatedSpeed) {
  const MorphModel model(make_sweep_face({0.6}));
  for (const std::uint64_t seed : {1, 2, 3, 4, 5}) {
    FaceClipSpec spec = small_spec();
    spec.seed = seed;
    spec.frames = 150;
    spec.frames_per_second = 25;
    spec.motion.sway = 0;
    const FaceMotion motion(spec, model);
    EXPECT_GE(motion.driven_count(), 10);
    double left = 0, right = 0, fastest = 0;
    double before = 0;
    for (int i = 0; i < 1500; ++i) {
      const Eigen::VectorXd x = motion.at(i / 250.0);
      const Eigen::Quaterniond turn(x[0], x[1], x[2], x[3]);
      const Eigen::Vector3d nose = turn * Eigen::Vector3d::UnitZ();
      const double yaw = std::atan2(nose.x(), nose.z()) * 57.29578;
      left = std::max(left, yaw), right = std::min(right, yaw);
      if (i > 0) fastest = std::max(fastest, 250 * std::abs(yaw - before));
      before = yaw;
    }
    EXPECT_GE(left, 0.85 * 40) << seed;
    EXPECT_LE(right, -0.85 * 40) << seed;
    EXPECT_LE(left, 46) << seed;
    EXPECT_LE(fastest, 1.15 * spec.motion.peak_speed_deg_s) << seed;
  }
}

TEST(MotionTest, EyesShutInABlinkAndTheMouthMovesAtSpeechTempo) {
  const MorphModel model(make_sweep_face({0.6}));
  const FaceClipSpec spec = [] {
    FaceClipSpec s = small_spec();
    s.frames = 250, s.frames_per_second = 25;
    return s;
  }();
  const FaceMotion motion(spec, model);
  const auto& space = model.parameters();
  const auto jaw = space.offset(space.block_index("jaw_open"));
  const auto lid = space.offset(space.block_index("eye_blink_left"));
  double most_shut = 0, previous = 0, slope = 0;
  int peaks = 0;
  for (int i = 0; i < 2500; ++i) {
    const Eigen::VectorXd x = motion.at(i / 250.0);
    most_shut = std::max(most_shut, x[lid]);
    const double rise = x[jaw] - previous;
    if (i > 1 && slope > 0 && rise <= 0 && x[jaw] > 0.05) ++peaks;
    slope = rise, previous = x[jaw];
  }
  EXPECT_GE(most_shut, 0.8);
  EXPECT_GE(peaks, 15);  // ten seconds at 4 syllables/s, less the pauses
  EXPECT_LE(peaks, 60);
}

TEST(GenerateTest, LipMarkersAreInThePictureWhereTheTruthSaysSo) {
  testing::TemporaryFolder folder;
  FaceClipSpec spec = small_spec();
  spec.frames = 3;
  spec.focal_px = 700;
  spec.motion.height_m = 0.07;
  spec.motion.yaw_deg = 5;
  spec.sensor.samples = 4;
  spec.markers.count = 16;
  spec.markers.red = 0.0, spec.markers.green = 0.0, spec.markers.blue = 1.0;
  const ClipFiles files = generate_clip(spec, (folder.path() / "clip").string());
  const LipTrack truth = read_lip_markers((folder.path() / "clip/lips.csv").string());
  ASSERT_EQ(truth.marker_count, 16);
  ASSERT_EQ(truth.frames.size(), 3u);
  VideoSource video(files.video);
  Rgb8 picture;
  int looked = 0;
  for (const LipFrame& frame : truth.frames) {
    ASSERT_TRUE(video.next(picture));
    const auto bluer = [&](const Eigen::Vector2d& p) {
      const std::size_t pixel =
          static_cast<std::size_t>(p.y()) * picture.width + static_cast<std::size_t>(p.x());
      return picture.data[3 * pixel + 2] > picture.data[3 * pixel];
    };
    for (const LipMarker& marker : frame.markers) {
      if (marker.state != MarkerState::seen) continue;
      EXPECT_TRUE(bluer(marker.position_px)) << marker.position_px.transpose();
      ++looked;
    }
    // Between the columns there is lip or skin.
    EXPECT_FALSE(bluer(0.5 * (frame.markers[5].position_px + frame.markers[6].position_px)));
    EXPECT_FALSE(bluer(0.5 * (frame.markers[9].position_px + frame.markers[10].position_px)));
  }
  EXPECT_GT(looked, 36);
}

}  // namespace
}  // namespace semblance
