// Procedural backgrounds: a wall, cluttered with things, some of them moving.
#pragma once

#include <vector>

#include "semblance/core/image.h"
#include "semblance/core/random.h"

namespace semblance {

/// A picture behind the head that depends on seed and time alone.
class Backdrop {
 public:
  /// `exposure` scales the light; `near_skin` is a colour (linear RGB) that some things have.
  Backdrop(int width, int height, bool clutter, float exposure, const Eigen::Vector3f& near_skin,
           Random random);
  /// Linear RGB at the time, opaque.
  Image at(double time_s) const;

 private:
  struct Thing {
    bool round = false;
    Eigen::Vector2f centre_px, half_px;
    float tilt = 0.0f;
    Eigen::Vector3f colour, stripe;
    float stripe_px = 0.0f;  // spacing of the stripes; 0: none
    float grain = 0.0f, grain_px = 8.0f;
    std::uint32_t noise_seed = 0;
    Eigen::Vector2f swing_px = Eigen::Vector2f::Zero();
    float swing_hz = 0.0f, swing_phase = 0.0f;
  };
  static void paint(const Thing& thing, double time_s, Image& image);
  Thing draw_thing(Random& random, const Eigen::Vector3f& near_skin, float exposure) const;

  Image still_;
  std::vector<Thing> moving_;
};

}  // namespace semblance
