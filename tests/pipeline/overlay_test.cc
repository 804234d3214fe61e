#include "semblance/pipeline/overlay.h"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <atomic>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <set>
#include <stdexcept>
#include <thread>

#include "semblance/core/errors.h"
#include "semblance/pipeline/background_queue.h"
#include "support.h"
#include "thin_wire.h"

namespace semblance {
namespace {

/// Sphere of rings and sectors with one vertex per pole.
Mesh make_sphere(double radius_m, int rings, int sectors) {
  Mesh mesh;
  mesh.positions_m.resize(2 + rings * sectors, 3);
  mesh.positions_m.row(0) << 0, radius_m, 0;
  mesh.positions_m.row(1) << 0, -radius_m, 0;
  const auto at = [&](int ring, int sector) { return 2 + ring * sectors + sector % sectors; };
  std::vector<Eigen::Vector3i> triangles;
  for (int r = 0; r < rings; ++r) {
    const double polar = M_PI * (r + 1) / (rings + 1);
    for (int s = 0; s < sectors; ++s) {
      const double turn = 2.0 * M_PI * s / sectors;
      mesh.positions_m.row(at(r, s)) << radius_m * std::sin(polar) * std::sin(turn),
          radius_m * std::cos(polar), radius_m * std::sin(polar) * std::cos(turn);
      if (r == 0) triangles.emplace_back(0, at(0, s), at(0, s + 1));
      if (r + 1 == rings) {
        triangles.emplace_back(1, at(r, s + 1), at(r, s));
      } else {
        triangles.emplace_back(at(r, s), at(r + 1, s), at(r + 1, s + 1));
        triangles.emplace_back(at(r, s), at(r + 1, s + 1), at(r, s + 1));
      }
    }
  }
  mesh.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t) mesh.triangles.row(t) = triangles[t];
  return mesh;
}

SceneObject place(const Mesh& mesh, const Eigen::Vector3d& centre_m) {
  SceneObject object;
  object.mesh = std::make_shared<const Mesh>(mesh);
  object.positions_m = (mesh.positions_m.rowwise() + centre_m.transpose().eval()).cast<float>();
  vertex_normals(object.positions_m, mesh.triangles, object.normals);
  return object;
}

Rgb8 plain_picture(int width, int height, std::uint8_t value) {
  return {width, height,
          std::vector<std::uint8_t>(static_cast<std::size_t>(width) * height * 3, value)};
}

TrackFrame frame_at(TrackStatus status) {
  TrackFrame frame;
  frame.frame = 7;
  frame.time_s = 0.28;
  frame.status = status;
  frame.rotation_wxyz << 1, 0, 0, 0;
  frame.translation_m << 0, 0, 10.0;  // behind the camera: no axes unless a test wants them
  return frame;
}

struct Rgb {
  int r, g, b;
};
Rgb pixel(const Rgb8& picture, int x, int y) {
  const std::uint8_t* p = &picture.data[(static_cast<std::size_t>(y) * picture.width + x) * 3];
  return {p[0], p[1], p[2]};
}

/// Pixels above the banner in which two pictures differ.
std::vector<Eigen::Vector2d> differences(const Rgb8& a, const Rgb8& b) {
  std::vector<Eigen::Vector2d> places;
  for (int y = 0; y < a.height - 40; ++y)
    for (int x = 0; x < a.width; ++x) {
      const Rgb p = pixel(a, x, y), q = pixel(b, x, y);
      if (p.r != q.r || p.g != q.g || p.b != q.b) places.emplace_back(x + 0.5, y + 0.5);
    }
  return places;
}

const Camera camera = Camera::centred(400, 300, 400.0);

TEST(OverlayScale, ReachesAReadableWidth) {
  EXPECT_EQ(overlay_scale(1920), 1);
  EXPECT_EQ(overlay_scale(640), 1);
  EXPECT_EQ(overlay_scale(639), 2);
  EXPECT_EQ(overlay_scale(400), 2);
  EXPECT_EQ(overlay_scale(319), 3);
}

TEST(OverlayPainter, PaintsLandmarksWhereTheyProject) {
  OverlayPainter painter(camera);
  const Rgb8 source = plain_picture(400, 300, 90);
  const Rgb8 empty = painter.paint(source, {}, frame_at(TrackStatus::tracked));
  for (const Eigen::Vector3d& point_m :
       {Eigen::Vector3d(0.03, 0.05, -0.5), Eigen::Vector3d(-0.111, -0.0123, -0.47)}) {
    TrackFrame frame = frame_at(TrackStatus::tracked);
    frame.landmarks_px = {project_world(camera, point_m)};
    const auto places = differences(painter.paint(source, {}, frame), empty);
    ASSERT_GT(places.size(), 4u);
    ASSERT_LT(places.size(), 60u);
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (const auto& place : places) mean += place / static_cast<double>(places.size());
    const Eigen::Vector2d expected(2.0 * (200.0 + 400.0 * point_m.x() / -point_m.z()),
                                   2.0 * (150.0 - 400.0 * point_m.y() / -point_m.z()));
    EXPECT_LT((mean - expected).norm(), 0.35);
  }
}

TEST(OverlayPainter, IgnoresLandmarksThatAreNotFinite) {
  OverlayPainter painter(camera);
  const Rgb8 source = plain_picture(400, 300, 90);
  TrackFrame frame = frame_at(TrackStatus::tracked);
  const Rgb8 empty = painter.paint(source, {}, frame);
  frame.landmarks_px = {{NAN, 3.0}, {1e12, 1e12}};
  EXPECT_THAT(differences(painter.paint(source, {}, frame), empty), ::testing::IsEmpty());
}

TEST(OverlayPainter, DrawsTheNoseAxisInBlue) {
  OverlayPainter painter(camera);
  TrackFrame frame = frame_at(TrackStatus::tracked);
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.6, Eigen::Vector3d::UnitY()));
  frame.rotation_wxyz << turn.w(), turn.x(), turn.y(), turn.z();
  frame.translation_m << 0.0, 0.0, -0.5;
  const Rgb8 picture = painter.paint(plain_picture(400, 300, 90), {}, frame);
  const Eigen::Vector3d along_m(0.06 * std::sin(0.6), 0.0, -0.5 + 0.06 * std::cos(0.6));
  const Rgb seen = pixel(picture, static_cast<int>(400 + 800 * along_m.x() / -along_m.z()), 300);
  EXPECT_GT(seen.b, 200);
  EXPECT_LT(seen.r, 110);
}

TEST(OverlayPainter, DrawsTheWireInsideTheOutlineOnly) {
  OverlayPainter painter(camera);
  const Rgb8 source = plain_picture(400, 300, 90);
  Scene scene;
  scene.objects.push_back(place(make_sphere(0.08, 40, 60), {0.02, 0.01, -0.6}));
  const auto places = differences(painter.paint(source, scene, frame_at(TrackStatus::tracked)),
                                  painter.paint(source, {}, frame_at(TrackStatus::tracked)));
  ASSERT_GT(places.size(), 1000u);
  for (const auto& place : places) {
    // A ray meets the sphere when the centre's distance from it is at most the radius.
    const Eigen::Vector3d ray =
        Eigen::Vector3d((place.x() - 400) / 800, -(place.y() - 300) / 800, -1.0).normalized();
    const double distance_m = Eigen::Vector3d(0.02, 0.01, -0.6).cross(ray).norm();
    EXPECT_LT(distance_m, 0.08 + 0.0015);  // a pixel is 0.75 mm wide there
  }
}

TEST(OverlayPainter, LeavesOutWhatIsHidden) {
  OverlayPainter painter(camera);
  const Rgb8 source = plain_picture(400, 300, 90);
  Scene front, both;
  front.objects.push_back(place(make_sphere(0.08, 40, 60), {0.0, 0.0, -0.5}));
  both = front;
  both.objects.push_back(place(make_sphere(0.05, 40, 60), {0.0, 0.0, -0.7}));
  const TrackFrame frame = frame_at(TrackStatus::tracked);
  EXPECT_THAT(differences(painter.paint(source, front, frame), painter.paint(source, both, frame)),
              ::testing::IsEmpty());
}

TEST(OverlayPainter, LostIsGreyInRedAndShowsNoEstimate) {
  OverlayPainter painter(camera);
  Rgb8 source = plain_picture(400, 300, 90);
  for (std::size_t i = 0; i < source.data.size(); i += 3) source.data[i] = 200;
  Scene scene;
  scene.objects.push_back(place(make_sphere(0.08, 20, 30), {0.0, 0.0, -0.5}));
  TrackFrame frame = frame_at(TrackStatus::lost);
  const Rgb8 lost = painter.paint(source, {}, frame);
  frame.landmarks_px = {{200, 150}};
  EXPECT_EQ(lost.data, painter.paint(source, scene, frame).data);
  for (const auto& [x, y] : {std::pair{2, 2}, {797, 2}, {400, 3}, {2, 300}, {797, 300}}) {
    const Rgb border = pixel(lost, x, y);
    EXPECT_GT(border.r, border.g + 100);
    EXPECT_GT(border.r, border.b + 100);
  }
  const Rgb inside = pixel(lost, 400, 300);
  EXPECT_EQ(inside.r, inside.g);
  EXPECT_EQ(inside.g, inside.b);
  const Rgb tracked = pixel(painter.paint(source, {}, frame_at(TrackStatus::tracked)), 2, 2);
  EXPECT_EQ(tracked.r, 200);
  EXPECT_EQ(tracked.b, 90);
}

TEST(OverlayPainter, BannerHasAColourPerState) {
  OverlayPainter painter(camera);
  const Rgb8 source = plain_picture(400, 300, 90);
  std::set<std::array<int, 3>> colours;
  for (const TrackStatus status :
       {TrackStatus::tracked, TrackStatus::lost, TrackStatus::reinitialised}) {
    const Rgb badge = pixel(painter.paint(source, {}, frame_at(status)), 4, 597);
    colours.insert({badge.r, badge.g, badge.b});
  }
  EXPECT_EQ(colours.size(), 3u);
}

TEST(OverlayPainter, RefusesAFrameOfAnotherSize) {
  OverlayPainter painter(camera);
  EXPECT_THROW(painter.paint(plain_picture(300, 400, 0), {}, frame_at(TrackStatus::tracked)),
               InvalidInput);
}

TEST(ThinWire, TriangulatesAClosedSurface) {
  const Mesh sphere = make_sphere(0.1, 60, 90);
  const ThinWire wire = thin_wire(sphere, 60);
  ASSERT_EQ(wire.vertices.size(), 60u);
  EXPECT_EQ(std::set<int>(wire.vertices.begin(), wire.vertices.end()).size(), 60u);
  // Euler: a triangulated sphere has 3 V - 6 edges, and none fewer unless four cells meet.
  EXPECT_LE(wire.edges.size(), 3u * 60u - 6u);
  EXPECT_GE(wire.edges.size(), 3u * 60u - 6u - 6u);
}

TEST(ThinWire, CrossesTextureSeamsAndLeavesOutSmallParts) {
  Mesh sphere = make_sphere(0.1, 20, 30);
  // The same sphere with every triangle's corners doubled, and a small one inside.
  const Mesh small = make_sphere(0.01, 20, 30);
  Mesh mesh;
  const auto n = sphere.triangle_count();
  mesh.positions_m.resize(3 * n + small.vertex_count(), 3);
  mesh.triangles.resize(n + small.triangle_count(), 3);
  for (int t = 0; t < n; ++t)
    for (int k = 0; k < 3; ++k) {
      mesh.positions_m.row(3 * t + k) = sphere.positions_m.row(sphere.triangles(t, k));
      mesh.triangles(t, k) = 3 * t + k;
    }
  mesh.positions_m.bottomRows(small.vertex_count()) = small.positions_m;
  mesh.triangles.bottomRows(small.triangle_count()) = small.triangles.array() + int(3 * n);
  const ThinWire wire = thin_wire(mesh, 30);
  EXPECT_EQ(wire.vertices.size(), 30u);
  for (const int v : wire.vertices) EXPECT_LT(v, 3 * n);
  EXPECT_GE(wire.edges.size(), 3u * 30u - 6u - 4u);
}

TEST(BackgroundQueue, KeepsOrderAndItsLimit) {
  std::vector<int> seen;
  std::atomic<int> started{0};
  int most_ahead = 0;
  BackgroundQueue<int> queue(3, [&](int& job) {
    ++started;
    if (job % 7 == 0) std::this_thread::sleep_for(std::chrono::microseconds(200));
    seen.push_back(job);
  });
  for (int i = 0; i < 300; ++i) {
    queue.push(i);
    most_ahead = std::max(most_ahead, i + 1 - started.load());
  }
  queue.finish();
  ASSERT_EQ(seen.size(), 300u);
  for (int i = 0; i < 300; ++i) EXPECT_EQ(seen[i], i);
  EXPECT_LE(most_ahead, 4);  // three waiting and one taken but not yet counted
}

TEST(BackgroundQueue, RethrowsWhatTheConsumerThrew) {
  std::atomic<int> consumed{0};
  BackgroundQueue<int> queue(2, [&](int& job) {
    if (job == 5) throw std::runtime_error("disk full");
    ++consumed;
  });
  EXPECT_THROW(
      {
        for (int i = 0; i < 100; ++i) queue.push(i);
      },
      std::runtime_error);
  EXPECT_THROW(queue.push(0), std::runtime_error);
  EXPECT_THROW(queue.finish(), std::runtime_error);
  EXPECT_EQ(consumed, 5);
}

TEST(BackgroundQueue, DropsWaitingJobsWithoutFinish) {
  std::atomic<bool> open{false};
  std::atomic<int> consumed{0};
  std::thread opener;
  {
    BackgroundQueue<int> queue(8, [&](int&) {
      while (!open) std::this_thread::yield();
      ++consumed;
    });
    for (int i = 0; i < 5; ++i) queue.push(i);
    opener = std::thread([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      open = true;
    });
  }
  opener.join();
  EXPECT_LE(consumed, 1);
}

TEST(OverlayWriter, WritesFramesInOrder) {
  const testing::TemporaryFolder folder;
  const std::string path = (folder.path() / "overlay.avi").string();
  const Camera small = Camera::centred(320, 240, 300.0);
  std::vector<int> painted;
  OverlayWriter writer(path, small, 25.0, [&](const Rgb8& picture, const TrackFrame& track) {
    EXPECT_EQ(picture.width, 640);
    painted.push_back(track.frame);
  });
  for (int i = 0; i < 12; ++i) {
    TrackFrame frame = frame_at(TrackStatus::tracked);
    frame.frame = i;
    writer.write(plain_picture(320, 240, static_cast<std::uint8_t>(20 * i)), {}, frame);
  }
  EXPECT_FALSE(std::filesystem::exists(path));
  writer.close();
  EXPECT_THAT(painted, ::testing::ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11));
  VideoSource video(path);
  Rgb8 frame;
  for (int i = 0; i < 12; ++i) {
    ASSERT_TRUE(video.next(frame));
    EXPECT_NEAR(pixel(frame, 320, 100).g, 20 * i, 6);
  }
  EXPECT_FALSE(video.next(frame));
}

TEST(OverlayWriter, RethrowsErrorsAndLeavesNoFile) {
  const testing::TemporaryFolder folder;
  const std::string path = (folder.path() / "overlay.avi").string();
  {
    OverlayWriter writer(path, Camera::centred(320, 240, 300.0), 25.0);
    const auto write_all = [&] {
      writer.write(plain_picture(100, 100, 0), {}, frame_at(TrackStatus::tracked));
      writer.close();
    };
    EXPECT_THROW(write_all(), InvalidInput);
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace semblance
