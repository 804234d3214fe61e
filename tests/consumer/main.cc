// Projects the corner of a cube and prints the pixel.
#include <semblance/core/camera.h>
#include <semblance/core/version.h>
#include <cmath>
#include <cstdio>

int main() {
  const auto camera = semblance::Camera::centred(640, 480, 500.0);
  const Eigen::Vector2d pixel = semblance::project_world(camera, {0.5, 0.5, -2.5});
  std::printf("%s: %.1f %.1f\n", semblance::program_version(), pixel.x(), pixel.y());
  return std::abs(pixel.x() - 420.0) < 1e-9 && std::abs(pixel.y() - 140.0) < 1e-9 ? 0 : 1;
}
