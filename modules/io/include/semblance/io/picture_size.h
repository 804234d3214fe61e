// A stored camera meets pictures: are they of the size that it was calibrated for?
#pragma once

#include <string>
#include <vector>

#include "semblance/core/camera.h"
#include "semblance/io/video.h"

namespace semblance {

/// How the size of pictures differs from that of a camera.
enum class SizeDifference {
  none,
  padded,  // one has its sides filled up to whole blocks of 16 pixels, as encoders store them
  turned,  // width and height changed places
  scaled,  // the same shape at another scale
  other
};
SizeDifference size_difference(const Camera& camera, int width, int height);

/// Throws InvalidInput that names pictures, camera and difference, unless there is none.
void require_camera_size(const Camera& camera, int width, int height, const std::string& pictures);

/// Columns and rows along a picture's sides that are black from end to end.
struct BlackBars {
  int left = 0, right = 0, top = 0, bottom = 0;

  bool any() const { return left + right + top + bottom > 0; }
};

/// Thin bars only: a side that is black over more than a twentieth of the picture is a dark
/// picture, and has none.
BlackBars black_bars(const Rgb8& picture);

/// The camera for pictures like `picture`, which may differ from its size by the filling of
/// encoders (1088 for 1080): `notes` then say so and what was assumed.
///
/// Where black bars show that the whole picture was scaled to the other size, the camera is scaled
/// and moved along. Otherwise the filling is taken to be at the right and at the bottom, where
/// encoders put it (H.264, ITU-T H.264 7.4.2.1.1, frame_crop_right_offset): nothing but the size
/// changes. Throws InvalidInput, as `require_camera_size` does, for every other difference.
Camera camera_for_pictures(const Camera& camera, const Rgb8& picture, const std::string& pictures,
                           std::vector<std::string>& notes);

}  // namespace semblance
