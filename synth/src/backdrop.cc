#include "backdrop.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "noise.h"
#include "semblance/synth/sensor.h"

namespace semblance {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

Vector3f draw_colour(Random& random) {
  // Furnishings are mostly dull: a grey level and a weak tint.
  const double level = std::exp(random.uniform(std::log(0.02), std::log(0.6)));
  Vector3f tint;
  for (int k = 0; k < 3; ++k) tint[k] = static_cast<float>(std::exp(0.18 * random.normal()));
  return (static_cast<float>(level) * tint).cwiseMin(0.9f);
}

}  // namespace

Backdrop::Backdrop(int width, int height, bool clutter, float exposure, const Vector3f& near_skin,
                   Random random)
    : still_(width, height, 3) {
  const Vector3f wall = exposure * (0.5f * draw_colour(random) + Vector3f::Constant(0.25f));
  const Vector2f slope(static_cast<float>(random.uniform(-0.5, 0.5)),
                       static_cast<float>(random.uniform(-0.4, 0.1)));
  const auto seed = static_cast<std::uint32_t>(random.integer(1 << 30));
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const Vector3f place(static_cast<float>(x) / 90, static_cast<float>(y) / 90, 0);
      const float shade = 1 + slope.x() * (static_cast<float>(x) / width - 0.5f) +
                          slope.y() * (static_cast<float>(y) / height - 0.5f) +
                          0.06f * fractal_noise(place, 5, seed);
      for (int c = 0; c < 3; ++c) still_.pixel(x, y)[c] = std::max(0.0f, wall[c] * shade);
    }
  if (!clutter) return;
  const int count = 26 + random.integer(12);
  for (int i = 0; i < count; ++i) paint(draw_thing(random, near_skin, exposure), 0.0, still_);
  blur_gaussian(still_, random.uniform(0.6, 1.8) * width / 640.0);  // out of focus
  for (int i = 0; i < 4; ++i) {
    Thing thing = draw_thing(random, near_skin, exposure);
    thing.half_px *= 0.7f;
    thing.swing_px = Vector2f(static_cast<float>(random.uniform(0.05, 0.25) * width),
                              static_cast<float>(random.uniform(0.0, 0.1) * height));
    thing.swing_hz = static_cast<float>(random.uniform(0.1, 0.5));
    thing.swing_phase = static_cast<float>(random.uniform(0, 2 * std::numbers::pi));
    moving_.push_back(thing);
  }
}

Backdrop::Thing Backdrop::draw_thing(Random& random, const Vector3f& near_skin,
                                     float exposure) const {
  Thing thing;
  const double scale = still_.width / 640.0;
  thing.round = random.uniform() < 0.3;
  thing.centre_px = Vector2f(static_cast<float>(random.uniform() * still_.width),
                             static_cast<float>(random.uniform() * still_.height));
  const double size = std::exp(random.uniform(std::log(12.0), std::log(110.0))) * scale;
  const double shape = std::exp(0.5 * random.normal());
  thing.half_px = Vector2f(static_cast<float>(size * shape), static_cast<float>(size / shape));
  thing.tilt = random.uniform() < 0.6 ? 0.0f : static_cast<float>(random.uniform(-0.6, 0.6));
  thing.colour = random.uniform() < 0.2
                     ? (near_skin * static_cast<float>(random.uniform(0.6, 1.2))).eval()
                     : draw_colour(random);
  thing.stripe = draw_colour(random) * exposure;
  thing.colour *= exposure;
  if (random.uniform() < 0.35) thing.stripe_px = static_cast<float>(random.uniform(6, 30) * scale);
  thing.grain = static_cast<float>(random.uniform(0.1, 0.6));
  thing.grain_px = static_cast<float>(random.uniform(3, 20) * scale);
  thing.noise_seed = static_cast<std::uint32_t>(random.integer(1 << 30));
  return thing;
}

void Backdrop::paint(const Thing& thing, double time_s, Image& image) {
  const float phase =
      static_cast<float>(2 * std::numbers::pi * thing.swing_hz * time_s) + thing.swing_phase;
  const Vector2f centre = thing.centre_px + thing.swing_px * std::sin(phase);
  const float reach = thing.half_px.norm() + 1;
  const int x0 = std::max(0, static_cast<int>(centre.x() - reach));
  const int x1 = std::min(image.width, static_cast<int>(centre.x() + reach) + 1);
  const int y0 = std::max(0, static_cast<int>(centre.y() - reach));
  const int y1 = std::min(image.height, static_cast<int>(centre.y() + reach) + 1);
  const float c = std::cos(thing.tilt), s = std::sin(thing.tilt);
  for (int y = y0; y < y1; ++y)
    for (int x = x0; x < x1; ++x) {
      const Vector2f gap(static_cast<float>(x) + 0.5f - centre.x(),
                         static_cast<float>(y) + 0.5f - centre.y());
      const Vector2f q(c * gap.x() + s * gap.y(), -s * gap.x() + c * gap.y());
      const float outside =
          thing.round ? (q.cwiseQuotient(thing.half_px).norm() - 1) * thing.half_px.minCoeff()
                      : (q.cwiseAbs() - thing.half_px).maxCoeff();
      const float cover = std::clamp(0.5f - outside, 0.0f, 1.0f);
      if (cover <= 0) continue;
      Vector3f colour = thing.colour;
      if (thing.stripe_px > 0 &&
          std::fmod(std::abs(q.x() + 1000), thing.stripe_px) < 0.4f * thing.stripe_px)
        colour = thing.stripe;
      colour *=
          std::max(0.2f, 1 + thing.grain * fractal_noise(Vector3f(q.x(), q.y(), 0) / thing.grain_px,
                                                         3, thing.noise_seed));
      float* pixel = image.pixel(x, y);
      for (int k = 0; k < 3; ++k) pixel[k] += cover * (colour[k] - pixel[k]);
    }
}

Image Backdrop::at(double time_s) const {
  Image image = still_;
  for (const Thing& thing : moving_) paint(thing, time_s, image);
  return image;
}

}  // namespace semblance
