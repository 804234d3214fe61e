#include "semblance/geometry/space_curve.h"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

const double pi = std::numbers::pi;

std::shared_ptr<const SpaceCurve> wild_spline() {
  return make_spline({{0, 0, 0}, {0.1, 0.3, 0.1}, {0.5, 0.3, -0.2}, {0.6, 0.8, 0}, {0.2, 1, 0.4}});
}

void expect_derivatives_are_differences(const SpaceCurve& curve) {
  const double h = 1e-5;
  for (const double s : {0.07, 0.31, 0.52, 0.88}) {
    const CurvePoint a = curve.at(s - h), b = curve.at(s + h), p = curve.at(s);
    EXPECT_LT((p.first - (b.point - a.point) / (2 * h)).norm(), 1e-7);
    EXPECT_LT((p.second - (b.first - a.first) / (2 * h)).norm(), 1e-5);
    EXPECT_LT((p.third - (b.second - a.second) / (2 * h)).norm(), 1e-3);
  }
}

TEST(SpaceCurve, DerivativesAreDifferences) {
  expect_derivatives_are_differences(*make_line({1, 2, 3}, {-1, 0, 2}));
  expect_derivatives_are_differences(*make_helix({1, 2, 3}, {1, 1, 0}, {2, 0, 3}, 5.0, 0.3));
  expect_derivatives_are_differences(*wild_spline());
}

TEST(SpaceCurve, HelixTurnsAndRises) {
  const auto helix = make_helix(Vector3d::Zero(), Vector3d::UnitZ(), {2, 0, 1}, 3.0 * pi, 0.5);
  EXPECT_LT((helix->at(0.0).point - Vector3d(2, 0, 1)).norm(), 1e-12);
  EXPECT_LT((helix->at(1.0).point - Vector3d(-2, 0, 1.75)).norm(), 1e-12);  // one turn and a half
}

TEST(SpaceCurve, SplinePassesItsPoints) {
  EXPECT_LT((wild_spline()->at(0.0).point - Vector3d(0, 0, 0)).norm(), 1e-14);
  EXPECT_LT((wild_spline()->at(1.0).point - Vector3d(0.2, 1, 0.4)).norm(), 1e-14);
  const auto two = make_spline({{0, 0, 0}, {1, 2, 2}});
  EXPECT_LT((two->at(0.25).point - Vector3d(0.25, 0.5, 0.5)).norm(), 1e-15);
}

void expect_orthonormal_with_derivatives(const MovingFrame& frame) {
  const double h = 1e-5;
  for (const double s : {0.013, 0.31, 0.5, 0.77, 0.99}) {
    const FramePoint f = frame.at(s), a = frame.at(s - h), b = frame.at(s + h);
    EXPECT_LT((f.tangent - frame.curve().at(s).first.normalized()).norm(), 1e-14);
    EXPECT_NEAR(f.normal.norm(), 1.0, 1e-12);
    EXPECT_NEAR(f.normal.dot(f.tangent), 0.0, 1e-12);
    EXPECT_LT((f.binormal - f.tangent.cross(f.normal)).norm(), 1e-12);
    EXPECT_LT((f.normal_ds - (b.normal - a.normal) / (2 * h)).norm(), 1e-5);
    EXPECT_LT((f.binormal_ds - (b.binormal - a.binormal) / (2 * h)).norm(), 1e-5);
  }
}

TEST(MovingFrame, FrenetFrameOfAHelixPointsToItsAxis) {
  const auto helix = make_helix({1, 2, 3}, Vector3d::UnitZ(), {3, 2, 3}, 4.0, 1.5);
  const MovingFrame frame(helix, FrameKind::frenet);
  expect_orthonormal_with_derivatives(frame);
  for (const double s : {0.0, 0.4, 1.0}) {
    Vector3d inwards = Vector3d(1, 2, 0) - helix->at(s).point;
    inwards.z() = 0.0;
    EXPECT_LT((frame.at(s).normal - inwards.normalized()).norm(), 1e-12);
  }
}

TEST(MovingFrame, AdaptedFrameKeepsThePlanesNormal) {
  const auto arc = make_helix(Vector3d::Zero(), Vector3d::UnitY(), {1, 0, 0}, 2.0);
  const MovingFrame frame(arc, FrameKind::adapted, Vector3d::UnitX());
  expect_orthonormal_with_derivatives(frame);
  for (const double s : {0.0, 0.5, 1.0}) {
    EXPECT_NEAR(std::abs(frame.at(s).binormal.y()), 1.0, 1e-12);
  }
  const MovingFrame straight(make_line({0, 0, 0}, {0, 0, 2}), FrameKind::adapted,
                             Vector3d::UnitX());
  EXPECT_LT((straight.at(0.3).normal - Vector3d::UnitX()).norm(), 1e-14);
}

TEST(MovingFrame, RotationMinimisingFrameOfAHelixUndoesItsTorsion) {
  // Against the Frenet frame it turns back by the integral of the torsion: c / (r^2 + c^2) per unit
  // of length, c = pitch / (2 pi).
  const double r = 2.0, pitch = 1.5, angle = 4.0, c = pitch / (2.0 * pi);
  const auto helix = make_helix(Vector3d::Zero(), Vector3d::UnitZ(), {r, 0, 0}, angle, pitch);
  const MovingFrame frenet(helix, FrameKind::frenet);
  const MovingFrame frame(helix, FrameKind::rotation_minimising, frenet.at(0.0).normal);
  expect_orthonormal_with_derivatives(frame);
  for (const double s : {0.25, 0.6, 1.0}) {
    const FramePoint a = frenet.at(s), b = frame.at(s);
    const double turned = std::atan2(b.normal.dot(a.binormal), b.normal.dot(a.normal));
    const double length = s * angle * std::sqrt(r * r + c * c);
    EXPECT_NEAR(turned, -length * c / (r * r + c * c), 1e-9);
  }
}

TEST(MovingFrame, RotationMinimisingFrameDoesNotTurnAboutTheTangent) {
  const MovingFrame frame(wild_spline(), FrameKind::rotation_minimising);
  expect_orthonormal_with_derivatives(frame);
  for (double s = 0.05; s < 1.0; s += 0.1) {
    EXPECT_NEAR(frame.at(s).normal_ds.dot(frame.at(s).binormal), 0.0, 1e-12);
  }
}

TEST(MovingFrame, SaysWhatToUseInstead) {
  EXPECT_THAT(
      [] {
        MovingFrame(make_line({0, 0, 0}, {1, 0, 0}), FrameKind::frenet);
      },
      ThrowsMessage<InvalidInput>(HasSubstr("rotation-minimising")));
  EXPECT_THAT([] { MovingFrame(wild_spline(), FrameKind::adapted); },
              ThrowsMessage<InvalidInput>(HasSubstr("does not lie in a plane")));
  EXPECT_THAT(
      [] {
        MovingFrame(make_line({0, 0, 0}, {1, 0, 0}), FrameKind::rotation_minimising,
                    Vector3d::UnitX());
      },
      ThrowsMessage<InvalidInput>(HasSubstr("'up'")));
  // There and back again: at the far point the curve stands still.
  for (const FrameKind kind :
       {FrameKind::frenet, FrameKind::adapted, FrameKind::rotation_minimising}) {
    EXPECT_THAT(
        [&] {
          MovingFrame(make_spline({{0, 0, 0}, {1, 0, 0}, {0, 0, 0}}), kind);
        },
        ThrowsMessage<InvalidInput>(HasSubstr("turns back at 50 %")));
  }
  EXPECT_THROW(make_line({1, 1, 1}, {1, 1, 1}), InvalidInput);
  EXPECT_THROW(make_helix({0, 0, 0}, {0, 0, 1}, {0, 0, 5}, 1.0), InvalidInput);
  EXPECT_THROW(make_spline({{0, 0, 0}, {0, 0, 0}, {1, 0, 0}}), InvalidInput);
}

}  // namespace
}  // namespace semblance
