#include "noise.h"

#include <algorithm>
#include <cmath>

namespace semblance {
namespace {

std::uint32_t hash(int x, int y, int z, std::uint32_t seed) {
  std::uint32_t h = seed * 0x9e3779b9u;
  for (const int value : {x, y, z}) {
    h ^= static_cast<std::uint32_t>(value) * 0x85ebca6bu;
    h = (h ^ (h >> 15)) * 0x2c1b3c6du;
    h ^= h >> 13;
  }
  h *= 0x297a2d39u;
  return h ^ (h >> 16);
}

// Dot product with one of the twelve edge directions of a cube.
float corner(int x, int y, int z, float dx, float dy, float dz, std::uint32_t seed) {
  const std::uint32_t h = hash(x, y, z, seed) % 12u;
  const float u = h < 8 ? dx : dy;
  const float v = h < 4 ? dy : dz;
  return ((h & 1) ? -u : u) + ((h & 2) ? -v : v);
}

float fade(float t) { return t * t * t * (t * (t * 6 - 15) + 10); }
float mix(float a, float b, float t) { return a + (b - a) * t; }

}  // namespace

float cell_value(int x, int y, int z, std::uint32_t seed) {
  return static_cast<float>(hash(x, y, z, seed) >> 8) * 0x1p-24f;
}

float gradient_noise(const Eigen::Vector3f& p, std::uint32_t seed) {
  const Eigen::Vector3f base = p.array().floor();
  const int x = static_cast<int>(base.x()), y = static_cast<int>(base.y()),
            z = static_cast<int>(base.z());
  const Eigen::Vector3f d = p - base;
  const float u = fade(d.x()), v = fade(d.y()), w = fade(d.z());
  float plane[2];
  for (int k = 0; k < 2; ++k) {
    float row[2];
    for (int j = 0; j < 2; ++j) {
      const float left = corner(x, y + j, z + k, d.x(), d.y() - j, d.z() - k, seed);
      const float right = corner(x + 1, y + j, z + k, d.x() - 1, d.y() - j, d.z() - k, seed);
      row[j] = mix(left, right, u);
    }
    plane[k] = mix(row[0], row[1], v);
  }
  return std::clamp(mix(plane[0], plane[1], w), -1.0f, 1.0f);
}

float fractal_noise(const Eigen::Vector3f& p, int octaves, std::uint32_t seed) {
  float sum = 0.0f, amplitude = 1.0f, frequency = 1.0f;
  for (int i = 0; i < octaves; ++i) {
    sum += amplitude * gradient_noise(p * frequency, seed + static_cast<std::uint32_t>(i));
    amplitude *= 0.5f;
    frequency *= 2.0f;
  }
  return sum;
}

float smooth_step(float edge0, float edge1, float x) {
  const float t = std::clamp((x - edge0) / (edge1 - edge0), 0.0f, 1.0f);
  return t * t * (3 - 2 * t);
}

}  // namespace semblance
