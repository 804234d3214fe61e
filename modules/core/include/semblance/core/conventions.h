// The conventions every part of Semblance follows. This header is the only place that states them.
//
// Units       metre, kilogram, second, radian. A scalar's name carries its unit: focal_px, time_s.
// Frames      a transform is named b_from_a and maps coordinates in a to coordinates in b.
//             World is right-handed with y up. A camera looks along +z with x right and y down
//             (OpenCV). A face's own frame has x to its left, y up and z out of the nose.
// Images      origin top-left, x right, y down. The centre of the first pixel is (0.5, 0.5), so an
//             image of width w covers [0, w). OpenCV, and files written with its convention, put
//             the centre of the first pixel at (0, 0): convert with the two functions below.
// Colour      linear RGB, float in [0, 1]. sRGB is decoded on reading and encoded on writing.
// Depth       z in the camera frame, not the length of the ray.
// Texture     u right, v up, (0, 0) is the lower left corner of the lower left texel.
#pragma once

#include <Eigen/Core>

namespace semblance {

/// Pixel coordinates of a tool that puts pixel centres at integers (OpenCV), from ours.
inline Eigen::Vector2d integer_centred_from_ours(const Eigen::Vector2d& point_px) {
  return point_px - Eigen::Vector2d::Constant(0.5);
}

/// Our pixel coordinates, from those of a tool that puts pixel centres at integers (OpenCV).
inline Eigen::Vector2d ours_from_integer_centred(const Eigen::Vector2d& point_px) {
  return point_px + Eigen::Vector2d::Constant(0.5);
}

/// Linear intensity from an sRGB-encoded value, both in [0, 1] (IEC 61966-2-1).
float linear_from_srgb(float encoded);
/// sRGB-encoded value from a linear intensity; the input is clamped to [0, 1].
float srgb_from_linear(float linear);

}  // namespace semblance
