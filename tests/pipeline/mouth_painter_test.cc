#include "mouth_painter.h"

#include <gtest/gtest.h>
#include <tiny_gltf.h>

#include <cmath>

#include "mouth_files.h"
#include "mouth_sheet.h"
#include "semblance/core/errors.h"
#include "semblance/pipeline/mouth_animation.h"
#include "support.h"
#include "talking_mouth.h"

namespace semblance {
namespace {

using Eigen::Vector2d;
using testing::TalkingMouth;

constexpr int width = 320, height = 300;

MouthPoints markers_at(const TalkingMouth& mouth, double time_s) {
  MouthPoints points(16, 3);
  for (int i = 0; i < 16; ++i) points.row(i) << mouth.marker(i, time_s).transpose(), 0.0;
  return points;
}

/// A picture whose red and green say where a pixel came from.
Image coordinates() {
  Image picture(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      float* pixel = picture.pixel(x, y);
      pixel[0] = (x + 0.5f) / width, pixel[1] = (y + 0.5f) / height, pixel[2] = 0.5f;
    }
  }
  return picture;
}

/// Where the colour at a place was in the picture of coordinates().
Vector2d origin_of(const Image& picture, const Vector2d& place_px) {
  float rgb[3];
  sample_bilinear(picture, float(place_px.x()), float(place_px.y()), rgb);
  return {rgb[0] * width, rgb[1] * height};
}

constexpr double open_s = 0.5, closed_s = 0.0;

TEST(MouthPainter, AtItsOwnMarkersThePictureIsUnchanged) {
  const MouthPoints markers = markers_at({}, open_s);
  const Image picture = coordinates();
  const Image painted = MouthPainter(MouthWireframe(markers), markers, picture).paint(markers);
  float difference = 0.0f;
  for (std::size_t i = 0; i < picture.data.size(); ++i) {
    difference = std::max(difference, std::abs(picture.data[i] - painted.data[i]));
  }
  EXPECT_LT(difference * width, 0.05f);  // pixels
}

TEST(MouthPainter, TextureGoesWithTheWireframe) {
  const TalkingMouth mouth;
  const MouthPoints from = markers_at(mouth, open_s), to = markers_at(mouth, 0.8);
  const MouthWireframe wireframe(from);
  const Image painted = MouthPainter(wireframe, from, coordinates()).paint(to);
  MouthPoints source, place;
  wireframe.evaluate(from, source);
  wireframe.evaluate(to, place);
  double largest_motion = 0.0;
  for (int c = 1; c < 3; ++c) {  // the rims have other triangles on one side
    for (int k = 0; k < wireframe.ring_size(); ++k) {
      const int i = c * wireframe.ring_size() + k;
      const Vector2d p = place.row(i).head<2>(), q = source.row(i).head<2>();
      EXPECT_LT((origin_of(painted, p) - q).norm(), 1.0) << i;
      largest_motion = std::max(largest_motion, (p - q).norm());
    }
  }
  EXPECT_GT(largest_motion, 5.0);
}

TEST(MouthPainter, FarFromTheMouthNothingMoves) {
  TalkingMouth mouth;
  mouth.width_px = 30.0;  // reach: 120
  const MouthPoints from = markers_at(mouth, closed_s), to = markers_at(mouth, 0.8);
  const Image painted = MouthPainter(MouthWireframe(from), from, coordinates()).paint(to);
  for (const Vector2d& p : {Vector2d(5, 5), Vector2d(315, 290), Vector2d(160, 296)}) {
    EXPECT_LT((origin_of(painted, p) - p).norm(), 0.01);
  }
}

TEST(MouthPainter, TheFaceFollowsAMovingHead) {
  TalkingMouth mouth, shifted;
  mouth.width_px = shifted.width_px = 60.0;
  shifted.middle_px += Vector2d(12.0, 5.0);
  const MouthPoints from = markers_at(mouth, closed_s), to = markers_at(shifted, closed_s);
  const Image painted = MouthPainter(MouthWireframe(from), from, coordinates()).paint(to);
  // Beside and above the lips, where a nose would be, the skin goes along nearly as a whole.
  for (const Vector2d& offset : {Vector2d(0, -30), Vector2d(40, -10), Vector2d(-38, 0)}) {
    const Vector2d place = shifted.middle_px + offset;
    EXPECT_LT((origin_of(painted, place) - (place - Vector2d(12.0, 5.0))).norm(), 2.0);
  }
}

TEST(MouthPainter, InsideIsDarkWhereThePictureShowsItClosed) {
  const TalkingMouth mouth;
  const MouthPoints closed = markers_at(mouth, closed_s), open = markers_at(mouth, open_s);
  const MouthWireframe wireframe(open);
  const Vector2d middle = 0.5 * (open.row(10) + open.row(14)).head<2>();
  float rgb[3];
  const Image opened = MouthPainter(wireframe, closed, coordinates()).paint(open);
  sample_bilinear(opened, float(middle.x()), float(middle.y()), rgb);
  EXPECT_LT(rgb[0] + rgb[1] + rgb[2], 0.1f);
  // But it is the picture's own where that shows it open.
  const Image kept = MouthPainter(wireframe, open, coordinates()).paint(open);
  EXPECT_LT((origin_of(kept, middle) - middle).norm(), 0.05);
  // No dark line between closed lips.
  const Image shut = MouthPainter(wireframe, open, coordinates()).paint(closed);
  const Vector2d lips = 0.5 * (closed.row(10) + closed.row(14)).head<2>();
  sample_bilinear(shut, float(lips.x()), float(lips.y()), rgb);
  EXPECT_GT(rgb[2], 0.45f);
}

TEST(MouthPainter, OpeningIsTheMeanHeight) {
  // A rectangle of straight lines: its area over the outer width.
  MouthPoints markers(16, 3);
  const double x[] = {0, 0, 10, 20, 20, 20, 10, 0}, y[] = {2, 0, 0, 0, 2, 4, 4, 4};
  for (int i = 0; i < 8; ++i) {
    markers.row(i) << 2.0 * x[i], 2.0 * y[i], 0.0;
    markers.row(8 + i) << x[i], y[i], 0.0;
  }
  MouthWireframeOptions options;
  options.between = MouthWireframeOptions::Between::linear;
  const MouthWireframe wireframe(markers, options);
  MouthPoints points;
  wireframe.evaluate(markers, points);
  EXPECT_NEAR(mouth_opening_px(wireframe, points), 20.0 * 4.0 / 40.0, 1e-12);
}

TEST(PictureSpace, ShowsEveryPointAtItsPixelWhateverItsDepth) {
  const PictureSpace space(640, 480, 60.0);
  MouthPoints points(3, 3);
  points << 100.0, 50.0, 0.0, 320.0, 240.0, 30.0, 600.0, 400.0, -20.0;
  const PointsF world = space.world_m(points);
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d p = world.row(i).transpose().cast<double>();
    EXPECT_LT((project_world(space.camera(), p) - points.row(i).head<2>().transpose()).norm(),
              1e-3);
  }
  // 30 pixels towards the camera are half a mouth's width, which is 51 mm.
  EXPECT_NEAR(world(1, 2) - world(0, 2), 0.0255, 1e-6);
}

TEST(MouthGlb, ShowsTheMotion) {
  const LipTrack track = TalkingMouth{}.track(30, 25.0);
  const MouthMotion motion({make_key(track, 2, 2), make_key(track, 9, 2)});
  MouthPoints markers, points;
  motion.at(motion.start_s(), markers);
  const MouthWireframe wireframe(markers);
  const PictureSpace space(width, height, 60.0);
  const std::vector<double> times = animation_times(motion.start_s(), motion.end_s(), 25.0);
  const testing::TemporaryFolder folder;
  const std::string path = folder.path() / "mouth.glb";
  write_mouth_glb(path, wireframe, motion, times, space, rgb8_from_linear(coordinates()));

  tinygltf::Model model;
  std::string errors, warnings;
  ASSERT_TRUE(tinygltf::TinyGLTF().LoadBinaryFromFile(&model, &errors, &warnings, path)) << errors;
  EXPECT_EQ(model.images.size(), 1u);
  ASSERT_EQ(model.animations.size(), 1u);
  const auto& primitive = model.meshes[0].primitives[0];
  EXPECT_EQ(primitive.targets.size(), times.size());
  // The lips' width in the file is that in the picture, on the scale of a mouth of 51 mm.
  const auto& accessor = model.accessors[primitive.attributes.at("POSITION")];
  wireframe.evaluate(markers, points);
  const double span_px = points.col(0).maxCoeff() - points.col(0).minCoeff();
  EXPECT_NEAR(accessor.maxValues[0] - accessor.minValues[0], 0.051 / 60.0 * span_px, 1e-6);
}

TEST(MouthSheet, StaysUnfoldedWhileTheMouthSpeaks) {
  const TalkingMouth mouth;
  const MouthPoints from = markers_at(mouth, open_s);
  const MouthSheet sheet(MouthWireframe(from), from);
  MouthPoints points;
  for (double t = 0.0; t < 3.0; t += 0.1) {
    sheet.move(markers_at(mouth, t), points);
    const int drawn = sheet.lip_triangle_count() + sheet.skin_triangle_count();
    for (int k = 0; k < drawn; ++k) {
      const auto corner = [&](int i) -> Vector2d {
        return points.row(sheet.triangles()(k, i)).head<2>();
      };
      const Vector2d a = corner(1) - corner(0), b = corner(2) - corner(0);
      EXPECT_LE(a.x() * b.y() - a.y() * b.x(), 1e-9) << "triangle " << k << " at " << t;
    }
  }
}

TEST(AnimationTimes, RunFromTheFirstKeyToTheLast) {
  const std::vector<double> times = animation_times(0.4, 1.42, 25.0);
  ASSERT_EQ(times.size(), 27u);  // 25.5 steps, rounded away from zero
  EXPECT_EQ(times.front(), 0.4);
  EXPECT_EQ(times.back(), 1.42);
  for (std::size_t i = 1; i < times.size(); ++i) {
    EXPECT_NEAR(times[i] - times[i - 1], 1.02 / 26.0, 1e-12);
  }
  EXPECT_EQ(animation_times(0.0, 0.001, 25.0).size(), 2u);
  EXPECT_THROW(animation_times(0.0, 1e9, 25.0), InvalidInput);
  EXPECT_THROW(animation_times(0.0, 1.0, -3.0), InvalidInput);
}

}  // namespace
}  // namespace semblance
