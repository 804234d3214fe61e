#include <algorithm>
#include <array>
#include <cmath>

#include "object_objective.h"
#include "semblance/object/object_report.h"

namespace semblance {
namespace {

using Colour = std::array<std::uint8_t, 3>;
constexpr Colour kOutline{60, 235, 90}, kWire{70, 190, 255}, kMark{255, 210, 40},
    kMiss{255, 70, 60};
constexpr double kPlanes = 10.0;  // over the object's size
constexpr double kWireShare = 0.55, kCross = 0.006;

class Canvas {
 public:
  explicit Canvas(Rgb8 picture) : picture_(std::move(picture)) {}
  Rgb8 take() { return std::move(picture_); }
  int width() const { return picture_.width; }

  void dot(int x, int y, const Colour& colour, double share = 1.0) {
    if (x < 0 || y < 0 || x >= picture_.width || y >= picture_.height) return;
    std::uint8_t* at =
        picture_.data.data() + std::size_t{3} * (static_cast<std::size_t>(y) * picture_.width + x);
    for (std::size_t c = 0; c < 3; ++c) {
      at[c] = static_cast<std::uint8_t>(std::lround(at[c] + share * (colour[c] - at[c])));
    }
  }
  void line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const Colour& colour) {
    const double length = std::min((to - from).norm(), 4.0 * picture_.width);
    if (!std::isfinite(length)) return;
    for (double t = 0.0; t <= length; t += 0.5) {
      const Eigen::Vector2d at = from + t / std::max(length, 1e-9) * (to - from);
      dot(static_cast<int>(std::floor(at.x())), static_cast<int>(std::floor(at.y())), colour);
    }
  }
  void cross(const Eigen::Vector2d& at, double arm_px, const Colour& colour) {
    line(at - Eigen::Vector2d(arm_px, 0.0), at + Eigen::Vector2d(arm_px, 0.0), colour);
    line(at - Eigen::Vector2d(0.0, arm_px), at + Eigen::Vector2d(0.0, arm_px), colour);
  }

 private:
  Rgb8 picture_;
};

/// Between which planes each pixel's surface point lies; -1 where there is none.
std::vector<int> slabs(const Synthesis& synthesis, const ObjectTarget& target) {
  const int width = synthesis.camera.width;
  std::vector<int> out(static_cast<std::size_t>(width) * synthesis.camera.height, -1);
  const VisiblePixels& seen = synthesis.pixels;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const auto& corner = target.topology.triangles[static_cast<std::size_t>(seen.triangle[i])];
    const double b1 = seen.b1[i], b2 = seen.b2[i];
    const Eigen::RowVector3d point = (1.0 - b1 - b2) * target.mesh.positions_m.row(corner[0]) +
                                     b1 * target.mesh.positions_m.row(corner[1]) +
                                     b2 * target.mesh.positions_m.row(corner[2]);
    int number = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const double slab = std::floor(kPlanes * (point[axis] / target.size_m + 0.5));
      number = 100 * number + std::clamp(static_cast<int>(slab), 0, 99);
    }
    out[static_cast<std::size_t>(seen.pixel[i])] = number;
  }
  return out;
}

void draw_mesh(const Synthesis& synthesis, const ObjectTarget& target, Canvas& canvas) {
  const int width = synthesis.camera.width, height = synthesis.camera.height;
  const std::vector<int> slab = slabs(synthesis, target);
  // A line's width grows with the picture, so that it is seen in a small copy too.
  const int thick = std::max(0, width / 1000);
  const auto draw = [&](int x, int y, const Colour& colour, double share) {
    for (int dy = 0; dy <= thick; ++dy) {
      for (int dx = 0; dx <= thick; ++dx) canvas.dot(x + dx, y + dy, colour, share);
    }
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int here = slab[static_cast<std::size_t>(y) * width + x];
      const int right = x + 1 < width ? slab[static_cast<std::size_t>(y) * width + x + 1] : -1;
      const int below = y + 1 < height ? slab[static_cast<std::size_t>(y + 1) * width + x] : -1;
      if ((here < 0) != (right < 0) || (here < 0) != (below < 0)) {
        draw(x, y, kOutline, 1.0);
      } else if (here != right || here != below) {
        draw(x, y, kWire, kWireShare);
      }
    }
  }
}

}  // namespace

Rgb8 object_overlay(const ObjectTarget& target, const ObjectPicture& picture,
                    const ObjectEstimate& estimate, std::size_t index) {
  Canvas canvas(rgb8_from_linear(picture.linear));
  const Rigid3& pose = estimate.poses[index].camera_from_object;
  const ObjectWorkspace workspace(target, 1);
  const ObjectObjective objective(workspace, estimate.camera, {.focal = false}, {PictureTerms{}},
                                  {{pose.rotation, pose * target.centre_m}});
  objective.with_synthesis(objective.start(), 0, [&](const Synthesis& synthesis) {
    draw_mesh(synthesis, target, canvas);
  });
  const double arm_px = std::max(3.0, kCross * canvas.width());
  for (const ObjectPair& pair : picture.pairs) {
    canvas.line(pair.pixel_px, project(estimate.camera, pose * pair.point_m), kMiss);
    canvas.cross(pair.pixel_px, arm_px, kMark);
  }
  return canvas.take();
}

Rgb8 object_overlays(const ObjectTarget& target, const ObjectPicture& picture,
                     const ObjectCalibration& calibration, std::size_t index) {
  const Rgb8 left = object_overlay(target, picture, calibration.from_pairs, index);
  if (!calibration.refined) return left;
  const Rgb8 right = object_overlay(target, picture, *calibration.refined, index);
  Rgb8 out{left.width + right.width, left.height, {}};
  const auto row_bytes = std::ptrdiff_t{3} * left.width;
  for (std::ptrdiff_t y = 0; y < left.height; ++y) {
    for (const Rgb8* half : {&left, &right}) {
      const auto row = half->data.begin() + y * row_bytes;
      out.data.insert(out.data.end(), row, row + row_bytes);
    }
  }
  return out;
}

}  // namespace semblance
