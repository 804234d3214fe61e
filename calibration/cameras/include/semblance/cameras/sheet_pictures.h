// Pictures and videos in which a sheet is looked for.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "semblance/cameras/detect.h"
#include "semblance/core/progress.h"

namespace semblance {

/// Where a picture is from; `frame` is -1 for a still.
struct PictureName {
  std::string file;
  int frame = -1;

  /// As in "left.jpg" or "cam.mp4 frame 12".
  std::string text() const;
};

struct Picture {
  PictureName name;
  Rgb8 image;
};

/// Hands every stride-th picture to `use`, until it returns false: stills (PNG, JPEG) in the order
/// given, the frames of videos and of folders of pictures. Every still counts, whatever the stride.
void for_each_picture(const std::vector<std::string>& files, int stride,
                      const std::function<bool(const Picture&)>& use);

/// The stride at which the longest of the videos has at most so many pictures; 1 for 0.
int even_stride(const std::vector<std::string>& files, int most_frames);

/// `identify_target` on the first pictures that show a sheet of a known kind.
Target identify_target_in(const std::vector<std::string>& files, const Target& automatic);

/// What one camera's pictures show of a sheet, one entry of each list per picture.
struct SheetPictures {
  Target target;
  std::vector<PictureName> names;
  std::vector<Detection> detections;
  std::vector<double> frames_per_second;  // of each video, as given
  double detect_s = 0.0;

  int found() const;  // pictures that show it
};

/// Looks for the sheet in all pictures; an `automatic` one is identified first. Videos longer than
/// `most_frames` are looked at in even steps; 0 takes every frame.
///
/// Throws SolverError, saying what is seen instead, where no picture shows the sheet.
SheetPictures find_sheet(const std::vector<std::string>& files, const Target& target,
                         int most_frames, Progress& progress);

}  // namespace semblance
