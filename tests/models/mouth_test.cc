// Key frames, motion, depths and wireframe of a mouth.
#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>

#include "semblance/core/errors.h"
#include "semblance/core/random.h"
#include "semblance/models/mouth_keys.h"
#include "semblance/models/mouth_motion.h"
#include "semblance/models/mouth_visemes.h"
#include "semblance/models/mouth_wireframe.h"
#include "talking_mouth.h"

namespace semblance {
namespace {

using Eigen::Vector2d;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::TalkingMouth;
using ::testing::ThrowsMessage;

MouthPoints points_at(const TalkingMouth& mouth, double time_s) {
  MouthPoints points(16, 3);
  for (int i = 0; i < 16; ++i) {
    points.row(i) << mouth.marker(i, time_s).transpose(), 2.0 * std::sin(i + time_s);
  }
  return points;
}

std::vector<Vector2d> in_picture(const MouthPoints& points) {
  std::vector<Vector2d> list;
  for (int i = 0; i < points.rows(); ++i) list.emplace_back(points.row(i).head<2>());
  return list;
}

std::vector<MouthKey> keys_of(const LipTrack& track, const std::vector<int>& rows) {
  std::vector<MouthKey> keys;
  for (const int row : rows) keys.push_back(make_key(track, row, 2));
  return keys;
}

// --- Motion ---

TEST(MouthMotion, PassesItsKeysWithoutAJumpOfVelocity) {
  const LipTrack track = TalkingMouth{}.track(60, 25.0);
  std::vector<MouthKey> keys = keys_of(track, {0, 11, 19, 40, 59});
  MarkerControls controls;
  controls.radial = {1.5, 0.3, 0.6, 0.7, 1.4};
  controls.tangential = {-0.4, 0.6, 1.2, 0.4, 0.8};
  const MouthMotion motion(keys, controls);
  MouthPoints position, velocity, before, after;
  for (const MouthKey& key : keys) {
    motion.at(key.time_s, position, &velocity);
    for (int i = 0; i < 16; ++i) {
      EXPECT_LT((position.row(i).head<2>().transpose() - key.position_px[i]).norm(), 1e-10);
      EXPECT_LT((velocity.row(i).head<2>().transpose() - key.velocity_px_s[i]).norm(), 1e-9);
    }
    if (key.time_s == motion.start_s() || key.time_s == motion.end_s()) continue;
    const double h = 1e-6;
    motion.at(key.time_s - h, before);
    motion.at(key.time_s + h, after);
    const MouthPoints left = (position - before) / h, right = (after - position) / h;
    EXPECT_LT((left - right).cwiseAbs().maxCoeff(), 0.02);  // px/s, of 100: h times the curvature
    EXPECT_GT(left.cwiseAbs().maxCoeff(), 1.0);
  }
}

TEST(MouthMotion, MovesWithThePicture) {
  // Turned, scaled and shifted key frames give the turned, scaled and shifted motion.
  const LipTrack track = TalkingMouth{}.track(60, 25.0);
  std::vector<MouthKey> keys = keys_of(track, {3, 20, 51}), moved = keys;
  const Eigen::Affine2d change =
      Eigen::Translation2d(30.0, -12.0) * Eigen::Rotation2Dd(0.7) * Eigen::Scaling(1.8);
  for (MouthKey& key : moved) {
    for (Vector2d& p : key.position_px) p = change * p;
    for (Vector2d& v : key.velocity_px_s) v = change.linear() * v;
  }
  MarkerControls controls;
  controls.radial.n = 3.0;
  controls.tangential.delta = 2.0;
  const MouthMotion motion(keys, controls), other(moved, controls);
  MouthPoints a, b;
  for (double t = motion.start_s(); t < motion.end_s(); t += 0.05) {
    motion.at(t, a);
    other.at(t, b);
    for (int i = 0; i < 16; ++i) {
      EXPECT_LT((change * a.row(i).head<2>().transpose() - b.row(i).head<2>().transpose()).norm(),
                1e-9);
    }
  }
}

TEST(MouthMotion, ReferenceLiesOnTheAxisAwayFromMarkers) {
  for (const double opening : {0.0, 0.2, 1.0}) {
    TalkingMouth mouth;
    mouth.opening = opening;
    for (double t = 0.0; t < 2.0; t += 0.1) {
      const std::vector<Vector2d> markers = in_picture(points_at(mouth, t));
      const Vector2d reference = mouth_reference(markers);
      EXPECT_NEAR((reference - markers[0]).norm(), (reference - markers[4]).norm(), 1e-9);
      for (const Vector2d& marker : markers) EXPECT_GT((marker - reference).norm(), 3.0);
      EXPECT_LT((reference - 0.5 * (markers[0] + markers[4])).norm(), mouth.width_px);
    }
  }
}

TEST(MouthMotion, RefusesWithAMessage) {
  const LipTrack track = TalkingMouth{}.track(20, 25.0);
  const auto refused = [](const std::vector<MouthKey>& keys, const std::string& message,
                          const std::optional<Vector2d>& reference = {}) {
    EXPECT_THAT([&] { MouthMotion(keys, {}, reference); },
                ThrowsMessage<InvalidInput>(HasSubstr(message)));
  };
  refused(keys_of(track, {4}), "at least two");
  refused(keys_of(track, {4, 4}), "key frames 4 and 4, marker 0");
  refused(keys_of(track, {9, 4}), "not in order of time");
  const std::vector<MouthKey> keys = keys_of(track, {4, 9});
  refused(keys, "marker 5: marker path: the marker lies on the reference point",
          keys[0].position_px[5]);
  std::vector<MouthKey> corners = keys;
  corners[0].position_px[4] = corners[0].position_px[0];
  refused(corners, "corners of the mouth");
}

// --- Key frames ---

TEST(MouthKeys, VelocityIsExactForEvenMotion) {
  LipTrack track = TalkingMouth{}.track(9, 25.0);
  const Vector2d velocity(31.0, -12.0);
  for (LipFrame& frame : track.frames) {
    frame.time_s = 0.04 * frame.frame + 0.001 * frame.frame * frame.frame;  // uneven
    for (int i = 0; i < 16; ++i) {
      frame.markers[i].position_px = Vector2d(10.0 * i, 0.0) + frame.time_s * velocity;
    }
  }
  track.frames[3].markers[7].state = MarkerState::absent;
  track.frames[3].markers[7].position_px = {1e6, 1e6};
  for (const int row : {0, 4, 8}) {
    for (const Vector2d& v : make_key(track, row, 2).velocity_px_s) {
      EXPECT_LT((v - velocity).norm(), 1e-9);
    }
  }
}

TEST(MouthKeys, VelocityApproachesTheDerivative) {
  const TalkingMouth mouth;
  const int row = 30;
  double error[2];
  for (int k = 0; k < 2; ++k) {
    const double rate = k == 0 ? 50.0 : 100.0, time = row / rate, h = 1e-6;
    const MouthKey key = make_key(mouth.track(60, rate), row, 2);
    error[k] = 0.0;
    for (int i = 0; i < 16; ++i) {
      const Vector2d truth = (mouth.marker(i, time + h) - mouth.marker(i, time - h)) / (2.0 * h);
      error[k] = std::max(error[k], (key.velocity_px_s[i] - truth).norm());
    }
  }
  EXPECT_LT(error[0], 4.0);
  EXPECT_LT(error[1], 1.5);
}

TEST(MouthKeys, TakeTheFilesVelocitiesWhenAsked) {
  LipTrack track = TalkingMouth{}.track(3, 25.0);
  track.frames[1].markers[5].velocity_px_s = {7.0, -3.0};
  EXPECT_EQ(make_key(track, 1, 0).velocity_px_s[5], Vector2d(7.0, -3.0));
}

TEST(MouthKeys, TwoAreEnoughForEvenMotion) {
  LipTrack track = TalkingMouth{}.track(40, 25.0);
  const LipFrame first = track.frames.front();
  for (LipFrame& frame : track.frames) {
    for (int i = 0; i < 16; ++i) {
      frame.markers[i].position_px =
          first.markers[i].position_px + frame.time_s * Vector2d(20.0 - i, 3.0 * i);
    }
  }
  const std::vector<int> rows = choose_keys(track, {});
  EXPECT_EQ(rows, (std::vector<int>{0, 39}));
  EXPECT_LT(motion_error(track, rows, MouthMotion(keys_of(track, rows))).worst_px, 1e-9);
}

/// The largest error of a frame, from positions alone.
double worst_error(const LipTrack& track, const std::vector<int>& rows) {
  const MouthMotion motion(keys_of(track, rows));
  MouthPoints points;
  double worst = 0.0;
  for (int row = rows.front(); row <= rows.back(); ++row) {
    motion.at(track.frames[row].time_s, points);
    double squared = 0.0;
    for (int i = 0; i < 16; ++i) {
      const Vector2d p = track.frames[row].markers[i].position_px;
      squared += (points.row(i).head<2>().transpose() - p).squaredNorm() / 16.0;
    }
    worst = std::max(worst, std::sqrt(squared));
  }
  return worst;
}

TEST(MouthKeys, AreAddedUntilTheToleranceIsMet) {
  const LipTrack track = TalkingMouth{}.track(100, 25.0);
  std::size_t before = 1000;
  for (const double tolerance : {0.3, 1.0, 3.0}) {
    KeyChoice choice;
    choice.tolerance_px = tolerance;
    const std::vector<int> rows = choose_keys(track, choice);
    EXPECT_LE(worst_error(track, rows), tolerance);
    EXPECT_NEAR(motion_error(track, rows, MouthMotion(keys_of(track, rows))).worst_px,
                worst_error(track, rows), 1e-9);
    EXPECT_LT(rows.size(), before);
    EXPECT_LT(rows.size(), 50u);
    before = rows.size();
  }
}

TEST(MouthKeys, AreBetterThanEvenlySpacedAndRandomOnes) {
  const LipTrack track = TalkingMouth{}.track(100, 25.0);
  for (const int budget : {5, 8, 12}) {
    KeyChoice choice;
    choice.most_keys = budget;
    choice.tolerance_px = 0.0;
    const std::vector<int> rows = choose_keys(track, choice);
    ASSERT_EQ(static_cast<int>(rows.size()), budget);
    EXPECT_TRUE(std::is_sorted(rows.begin(), rows.end()));
    const auto rms = [&](const std::vector<int>& chosen) {
      return motion_error(track, chosen, MouthMotion(keys_of(track, chosen))).rms_px;
    };
    std::vector<int> even;
    for (int k = 0; k < budget; ++k) even.push_back(k * 99 / (budget - 1));
    EXPECT_LT(rms(rows), rms(even)) << budget;
    Random random(budget);
    for (int trial = 0; trial < 20; ++trial) {
      std::set<int> others{0, 99};
      while (static_cast<int>(others.size()) < budget) others.insert(random.integer(100));
      EXPECT_LT(rms(rows), rms({others.begin(), others.end()})) << budget;
    }
  }
}

TEST(MouthKeys, AreCompleteFrames) {
  LipTrack track = TalkingMouth{}.track(50, 25.0);
  for (const int row : {0, 1, 17, 18, 49}) {
    track.frames[row].markers[row % 16].state = MarkerState::absent;
  }
  KeyChoice choice;
  choice.tolerance_px = 0.0;
  const std::vector<int> rows = choose_keys(track, choice);
  EXPECT_EQ(rows.size(), 45u);
  EXPECT_EQ(rows.front(), 2);
  EXPECT_EQ(rows.back(), 48);
  for (const int row : rows) EXPECT_TRUE(is_complete(track.frames[row]));
}

TEST(MouthKeys, RefuseWithAMessage) {
  LipTrack track = TalkingMouth{}.track(5, 25.0);
  EXPECT_THAT([&] { find_frame(track, 12); },
              ThrowsMessage<InvalidInput>(HasSubstr("frame 12 is not in the table, which has 5")));
  track.frames[4].markers[6].velocity_px_s = {1e300, 0.0};
  EXPECT_THAT([&] { make_key(track, 4, 0); },
              ThrowsMessage<InvalidInput>(HasSubstr("frame 4: marker 6")));
  track.frames[3].markers[4].position_px = track.frames[3].markers[0].position_px;
  EXPECT_THAT([&] { make_key(track, 3, 2); },
              ThrowsMessage<InvalidInput>(AllOf(HasSubstr("frame 3 cannot be a key frame"),
                                                HasSubstr("the corners of the mouth"))));
  for (LipFrame& frame : track.frames) {
    if (frame.frame != 2) frame.markers[3].state = MarkerState::absent;
  }
  EXPECT_THAT([&] { make_key(track, 1, 2); },
              ThrowsMessage<InvalidInput>(HasSubstr("marker 3 is absent")));
  EXPECT_THAT([&] { make_key(track, 2, 2); },
              ThrowsMessage<InvalidInput>(HasSubstr("it has no velocity")));
  EXPECT_THAT([&] { choose_keys(track, {}); },
              ThrowsMessage<InvalidInput>(HasSubstr("1 frame(s) with all markers")));
}

TEST(MouthKeys, InnerContourOfEightMarkersClosesWhereTheMouthDoes) {
  TalkingMouth mouth;
  const LipTrack outer = mouth.track(30, 25.0, 8), track = with_inner_contour(outer);
  ASSERT_EQ(track.marker_count, 16);
  const auto at = [&](int row, int i) { return track.frames[row].markers[i].position_px; };
  // The mouth starts closed.
  for (const int i : {1, 2, 3}) EXPECT_LT((at(0, 8 + i) - at(0, 16 - i)).norm(), 1e-9);
  for (int row = 0; row < 30; ++row) {
    const Vector2d along = (at(row, 4) - at(row, 0)).normalized();
    const Vector2d first_along = (at(0, 4) - at(0, 0)).normalized();
    for (int i = 0; i < 8; ++i) {
      EXPECT_EQ(track.frames[row].markers[8 + i].state, MarkerState::bridged);
      const Vector2d inset = at(row, 8 + i) - at(row, i), first = at(0, 8 + i) - at(0, i);
      EXPECT_NEAR(inset.norm(), first.norm(), 1e-9);
      EXPECT_NEAR(inset.dot(along), first.dot(first_along), 1e-9);
    }
  }
  EXPECT_EQ(with_inner_contour(track).frames[3].markers[9].position_px, at(3, 9));
}

// --- Depth ---

const std::vector<Viseme>& visemes_of_the_face() {
  static const std::vector<Viseme> visemes = builtin_visemes();
  return visemes;
}

TEST(Visemes, ClosestOneIsFoundWhateverItsPlaceInThePicture) {
  const std::vector<Viseme>& visemes = visemes_of_the_face();
  ASSERT_EQ(visemes.size(), 5u);
  Random random(4);
  for (std::size_t v = 0; v < visemes.size(); ++v) {
    const double scale = random.uniform(500.0, 3000.0);
    const Eigen::Rotation2Dd turn(random.uniform(-0.8, 0.8));
    const Vector2d shift(random.uniform(0.0, 600.0), random.uniform(0.0, 400.0));
    std::vector<Vector2d> markers;
    for (const Eigen::Vector3d& m : visemes[v].markers_m) {
      markers.push_back(shift + scale * (turn * Vector2d(m.x(), -m.y())));
    }
    const VisemeMatch match = closest_viseme(visemes, markers);
    EXPECT_EQ(match.viseme, static_cast<int>(v));
    EXPECT_LT(match.rms_px, 1e-9);
    EXPECT_NEAR(match.scale_px_m, scale, 1e-6);

    std::vector<MouthKey> keys{{0, 0.0, markers, markers, std::vector<double>(16, 0.0), ""}};
    assign_depths(visemes, keys);
    EXPECT_EQ(keys[0].viseme, visemes[v].name);
    const auto& m = visemes[v].markers_m;
    EXPECT_NEAR(keys[0].depth_px[2] - keys[0].depth_px[0], scale * (m[2].z() - m[0].z()), 1e-6);
  }
}

TEST(Visemes, BuiltinOnesAreArticulations) {
  const std::vector<Viseme>& visemes = visemes_of_the_face();
  const auto find = [&](const std::string& name) {
    return std::find_if(visemes.begin(), visemes.end(),
                        [&](const Viseme& v) { return v.name == name; })
        ->markers_m;
  };
  const auto opening = [](const auto& m) { return m[10].y() - m[14].y(); };
  const auto width = [](const auto& m) { return (m[4] - m[0]).norm(); };
  EXPECT_LT(std::abs(opening(find("rest"))), 0.002);
  EXPECT_GT(opening(find("a")), 0.015);
  EXPECT_GT(opening(find("a")), opening(find("i")) + 0.01);
  EXPECT_GT(width(find("i")), width(find("rest")) + 0.003);
  EXPECT_LT(width(find("u")), width(find("rest")) - 0.005);
  EXPECT_GT(find("u")[2].z(), find("rest")[2].z() + 0.003);  // lips forwards
}

// --- Wireframe ---

TEST(MouthWireframe, KeepsFibreProportionsAtAllTimes) {
  const TalkingMouth mouth;
  for (const auto between :
       {MouthWireframeOptions::Between::linear, MouthWireframeOptions::Between::smooth}) {
    MouthWireframeOptions options;
    options.fibres = {0.3, 0.8};
    options.between = between;
    const MouthWireframe wireframe(points_at(mouth, 0.4), options);
    ASSERT_EQ(wireframe.point_count(), 160);
    MouthPoints p;
    for (double t = 0.0; t < 3.0; t += 0.17) {
      const MouthPoints markers = points_at(mouth, t);
      wireframe.evaluate(markers, p);
      for (int i = 0; i < 8; ++i) {
        const Eigen::RowVector3d a0 = p.row(wireframe.index(0, i)),
                                 a3 = p.row(wireframe.index(3, i));
        EXPECT_LT((a0 - markers.row(i)).norm(), 1e-9);
        EXPECT_LT((a3 - markers.row(8 + i)).norm(), 1e-9);
        for (int k = 0; k < 5; ++k) {
          const auto at = [&](int c) { return p.row(wireframe.index(c, i, k)); };
          const double whole = (at(3) - at(0)).norm();
          EXPECT_NEAR((at(1) - at(0)).norm(), 0.3 * whole, 1e-9);
          EXPECT_NEAR((at(2) - at(0)).norm(), 0.8 * whole, 1e-9);
          EXPECT_NEAR((at(1) - at(0)).norm() + (at(3) - at(1)).norm(), whole, 1e-9);
        }
      }
    }
  }
}

TEST(MouthWireframe, LinearPointsDivideTheChord) {
  const MouthPoints markers = points_at({}, 0.7);
  MouthWireframeOptions options;
  options.between = MouthWireframeOptions::Between::linear;
  const MouthWireframe wireframe(markers, options);
  MouthPoints p;
  wireframe.evaluate(markers, p);
  for (int i = 0; i < 8; ++i) {
    for (int k = 0; k < 5; ++k) {
      const Eigen::RowVector3d expected =
          markers.row(i) + k / 5.0 * (markers.row((i + 1) % 8) - markers.row(i));
      EXPECT_LT((p.row(wireframe.index(0, i, k)) - expected).norm(), 1e-12);
    }
  }
}

TEST(MouthWireframe, SmoothContourOfACircleIsNearlyTheCircle) {
  MouthPoints markers(16, 3);
  for (int i = 0; i < 16; ++i) {
    const double angle = std::numbers::pi * (1.0 + i / 4.0), r = i < 8 ? 30.0 : 10.0;
    markers.row(i) << 100.0 + r * std::cos(angle), 80.0 + r * std::sin(angle), 5.0;
  }
  MouthWireframeOptions options;
  options.points_between = 19;
  const MouthWireframe wireframe(markers, options);
  MouthPoints p;
  wireframe.evaluate(markers, p);
  // Midway between knots h apart, the periodic spline of e^(i u) has this length in closed form:
  // its second derivatives at the knots are -6 / h^2 (1 - cos h) / (2 + cos h) times the values.
  const double h = std::numbers::pi / 4.0,
               least = 30.0 * std::cos(0.5 * h) *
                       (1.0 + 0.75 * (1.0 - std::cos(h)) / (2.0 + std::cos(h)));
  const int ring = wireframe.ring_size();
  for (int k = 0; k < ring; ++k) {
    const double radius = std::hypot(p(k, 0) - 100.0, p(k, 1) - 80.0);
    EXPECT_LE(radius, 30.0 + 1e-9);
    EXPECT_GE(radius, least - 1e-9);
    if (k % 20 == 10) {
      EXPECT_NEAR(radius, least, 1e-9);
    }
    EXPECT_NEAR(p(k, 2), 5.0, 1e-12);
    // Closed: the step over the end is like the others.
    EXPECT_NEAR((p.row((k + 1) % ring) - p.row(k)).norm(), 60.0 * std::numbers::pi / ring, 0.02);
  }
}

TEST(MouthWireframe, SmoothContourHasNoCornersAndDoesNotSwingFarOut) {
  const MouthPoints markers = points_at({}, 0.45);
  MouthWireframeOptions options;
  options.points_between = 99;
  const MouthWireframe wireframe(markers, options);
  MouthPoints p;
  wireframe.evaluate(markers, p);
  const int ring = wireframe.ring_size();
  for (int k = 0; k < ring; ++k) {
    const Eigen::RowVector3d a = p.row(k) - p.row((k + ring - 1) % ring),
                             b = p.row((k + 1) % ring) - p.row(k);
    // At a knot the parameter's speed changes with the gap, but not the direction.
    EXPECT_GT(a.normalized().dot(b.normalized()), std::cos(0.2)) << k;
  }
  const double margin = 0.06 * TalkingMouth{}.width_px;
  EXPECT_GT(p.col(0).minCoeff(), markers.col(0).minCoeff() - margin);
  EXPECT_LT(p.col(1).maxCoeff(), markers.col(1).maxCoeff() + margin);
}

TEST(MouthWireframe, MeshIsARibbonOfCounterClockwiseTriangles) {
  const MouthPoints markers = points_at({}, 0.5);
  const MouthWireframe wireframe(markers);
  MouthPoints p;
  wireframe.evaluate(markers, p);
  double area = 0.0;
  for (int t = 0; t < wireframe.triangles().rows(); ++t) {
    const auto corner = [&](int k) -> Vector2d {
      return p.row(wireframe.triangles()(t, k)).head<2>().cwiseProduct(Eigen::RowVector2d(1, -1));
    };
    const Vector2d a = corner(1) - corner(0), b = corner(2) - corner(0);
    EXPECT_GT(a.x() * b.y() - a.y() * b.x(), 0.0) << t;
    area += 0.5 * (a.x() * b.y() - a.y() * b.x());
  }
  const auto inside = [&](int contour) {
    double twice = 0.0;
    for (int k = 0; k < wireframe.ring_size(); ++k) {
      const int a = contour * wireframe.ring_size() + k,
                b = contour * wireframe.ring_size() + (k + 1) % wireframe.ring_size();
      twice += p(a, 0) * p(b, 1) - p(a, 1) * p(b, 0);
    }
    return 0.5 * twice;
  };
  EXPECT_NEAR(area, inside(0) - inside(3), 1e-9);
  // One boundary at C0 and one at C3: vertices - edges + triangles of a ring is zero.
  EXPECT_EQ(wireframe.triangles().rows(), 240);
}

TEST(MouthWireframe, RefusesWithAMessage) {
  const MouthPoints markers = points_at({}, 0.5);
  const auto refused = [&](const MouthPoints& points, const MouthWireframeOptions& options,
                           const std::string& message) {
    EXPECT_THAT([&] { MouthWireframe(points, options); },
                ThrowsMessage<InvalidInput>(HasSubstr(message)));
  };
  MouthWireframeOptions options;
  options.fibres = {0.7, 0.3};
  refused(markers, options, "must increase between 0 and 1");
  options = {};
  options.points_between = -1;
  refused(markers, options, "-1 points between markers");
  refused(markers.topRows(8), {}, "16 finite lip markers");
  MouthPoints doubled = markers;
  doubled.row(3) = doubled.row(2), doubled.row(11) = doubled.row(10);
  refused(doubled, {}, "lip markers 2 and 3 are at one place");
  doubled(5, 0) = std::nan("");
  refused(doubled, {}, "16 finite lip markers");
}

}  // namespace
}  // namespace semblance
