// Where the 16 lip markers of io/lip_markers.h lie on a face with the 68 landmarks of iBUG.
#pragma once

#include <array>

namespace semblance {

/// Halfway between two landmarks (which may be the same).
struct LipPoint {
  int first = 0, second = 0;
};

/// The outer contour's markers stand at about even distances: its quarters lie between landmarks.
inline constexpr std::array<LipPoint, 16> lip_points = {{{48, 48},
                                                         {49, 50},
                                                         {51, 51},
                                                         {52, 53},
                                                         {54, 54},
                                                         {55, 56},
                                                         {57, 57},
                                                         {58, 59},
                                                         {60, 60},
                                                         {61, 61},
                                                         {62, 62},
                                                         {63, 63},
                                                         {64, 64},
                                                         {65, 65},
                                                         {66, 66},
                                                         {67, 67}}};

/// Marker `i` from 68 landmarks, of any type that has sums and multiples.
template <class Landmarks>
auto lip_point(const Landmarks& landmarks, int i) {
  using Point = typename Landmarks::value_type;
  using Scalar = typename Point::Scalar;
  const LipPoint& point = lip_points[static_cast<std::size_t>(i)];
  return Point(Scalar(0.5) * (landmarks[static_cast<std::size_t>(point.first)] +
                              landmarks[static_cast<std::size_t>(point.second)]));
}

}  // namespace semblance
