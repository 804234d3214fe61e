#include "semblance/io/picture_size.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

constexpr int kBlock = 16;         // pixels; what H.264 codes pictures in
constexpr int kBlack = 48;         // of 255: black with the noise of compression
constexpr int kThinnestPart = 20;  // of a side, for the widest bar

int filled_up(int pixels) { return (pixels + kBlock - 1) / kBlock * kBlock; }

bool equal_or_filled(int a, int b) { return a == b || std::max(a, b) == filled_up(std::min(a, b)); }

const char* remedy(SizeDifference difference) {
  switch (difference) {
    case SizeDifference::padded:
      return "encoders fill pictures up to whole blocks of 16 pixels, and one of the two has this "
             "filling. Cut it off, or calibrate from pictures as they are";
    case SizeDifference::turned:
      return "the picture lies on its side. Turn the pictures alike, or calibrate the upright ones "
             "by themselves";
    case SizeDifference::scaled:
      return "the shape is the same, the scale is not. Give the pictures in their first size, or "
             "calibrate from pictures of this one: cameras cut when they change their resolution";
    default:
      return "a calibration holds for one size alone. Calibrate from pictures of this size, or "
             "leave out those of another";
  }
}

std::string sizes(const Camera& camera, int width, int height, const std::string& pictures) {
  return fmt::format("{} has {} x {} pixels, but camera '{}' is one of {} x {}", pictures, width,
                     height, camera.name, camera.width, camera.height);
}

bool is_black(const Rgb8& picture, int x, int y) {
  const auto* pixel = &picture.data[3 * (static_cast<std::size_t>(y) * picture.width + x)];
  return std::max({pixel[0], pixel[1], pixel[2]}) < kBlack;
}

bool is_black_column(const Rgb8& picture, int x) {
  for (int y = 0; y < picture.height; ++y) {
    if (!is_black(picture, x, y)) return false;
  }
  return true;
}

bool is_black_row(const Rgb8& picture, int y) {
  for (int x = 0; x < picture.width; ++x) {
    if (!is_black(picture, x, y)) return false;
  }
  return true;
}

/// Lines 0, 1, 2, ... that are black, none where there are too many.
template <class IsBlack>
int bar_width(int side, const IsBlack& is_black_line) {
  const int widest = side / kThinnestPart;
  int width = 0;
  while (width <= widest && is_black_line(width)) ++width;
  return width > widest ? 0 : width;
}

/// The camera of pictures that were shrunk or enlarged as a whole to fit, with bars for the rest;
/// none where the bars are not those.
std::optional<Camera> scaled_with_bars(const Camera& camera, const Rgb8& picture,
                                       const BlackBars& bars) {
  const double scale = std::min(static_cast<double>(picture.width) / camera.width,
                                static_cast<double>(picture.height) / camera.height);
  const Eigen::Vector2d shift = 0.5 * Eigen::Vector2d(picture.width - scale * camera.width,
                                                      picture.height - scale * camera.height);
  constexpr double tolerance = 2.0;  // rows: scalers round, and a bar's last row may be mixed
  const auto as_expected = [](double expected, int found) {
    return expected < 1.0 ? found == 0 : std::abs(found - expected) <= tolerance;
  };
  const bool explained = shift.maxCoeff() >= 1.0 && as_expected(shift.x(), bars.left) &&
                         as_expected(shift.x(), bars.right) && as_expected(shift.y(), bars.top) &&
                         as_expected(shift.y(), bars.bottom);
  if (!explained) return std::nullopt;
  Camera result = camera;
  result.focal_px *= scale;
  result.principal_px = scale * camera.principal_px + shift;
  return result;
}

}  // namespace

SizeDifference size_difference(const Camera& camera, int width, int height) {
  if (width == camera.width && height == camera.height) return SizeDifference::none;
  if (equal_or_filled(width, camera.width) && equal_or_filled(height, camera.height)) {
    return SizeDifference::padded;
  }
  if (width == camera.height && height == camera.width) return SizeDifference::turned;
  const double scale = static_cast<double>(width) / camera.width;
  if (std::abs(scale * camera.height - height) <= 1.0) return SizeDifference::scaled;
  return SizeDifference::other;
}

void require_camera_size(const Camera& camera, int width, int height, const std::string& pictures) {
  const SizeDifference difference = size_difference(camera, width, height);
  if (difference == SizeDifference::none) return;
  throw InvalidInput(sizes(camera, width, height, pictures) + ": " + remedy(difference));
}

BlackBars black_bars(const Rgb8& picture) {
  const auto column = [&](int x) { return is_black_column(picture, x); };
  const auto row = [&](int y) { return is_black_row(picture, y); };
  return {bar_width(picture.width, column),
          bar_width(picture.width, [&](int x) { return column(picture.width - 1 - x); }),
          bar_width(picture.height, row),
          bar_width(picture.height, [&](int y) { return row(picture.height - 1 - y); })};
}

Camera camera_for_pictures(const Camera& camera, const Rgb8& picture, const std::string& pictures,
                           std::vector<std::string>& notes) {
  if (size_difference(camera, picture.width, picture.height) != SizeDifference::padded) {
    require_camera_size(camera, picture.width, picture.height, pictures);
    return camera;
  }
  const BlackBars bars = black_bars(picture);
  const std::string cause = sizes(camera, picture.width, picture.height, pictures) +
                            ": encoders fill pictures up to whole blocks of 16 pixels";
  const std::optional<Camera> scaled = scaled_with_bars(camera, picture, bars);
  Camera result = scaled.value_or(camera);
  result.width = picture.width;
  result.height = picture.height;
  if (scaled) {
    notes.push_back(fmt::format(
        "{}. Its black bars (left {}, right {}, top {}, bottom {}) are those of a picture scaled "
        "to the other size: the camera was scaled by {:.4f} along with it",
        cause, bars.left, bars.right, bars.top, bars.bottom,
        scaled->focal_px.x() / camera.focal_px.x()));
  } else {
    notes.push_back(fmt::format(
        "{}. The filling was taken to be at the right and the bottom: focal length and principal "
        "point were kept. If the pictures were scaled instead, both are off by up to {:.1f} %",
        cause,
        100.0 * std::max(std::abs(static_cast<double>(picture.width) / camera.width - 1.0),
                         std::abs(static_cast<double>(picture.height) / camera.height - 1.0))));
  }
  return result;
}

}  // namespace semblance
