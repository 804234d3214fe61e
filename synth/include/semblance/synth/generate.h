// Making clips: pictures, camera and exact truth.
#pragma once

#include <string>

#include "semblance/core/progress.h"
#include "semblance/synth/clip_spec.h"

namespace semblance {

/// Where a clip's files are.
struct ClipFiles {
  std::string name;    ///< of the clip
  std::string video;   ///< folder of PNG images, or clip.mp4 / clip.avi
  std::string camera;  ///< camera.json
  std::string truth;   ///< truth.jsonl, semblance.track/1
};

/// Renders the clip into `folder`, which must not exist, be empty or hold an earlier clip (which is
/// replaced when the new one is complete). Beside the pictures it leaves camera.json, spec.json and
/// truth.jsonl. The same spec gives the same bytes for any number of threads.
///
/// Truth, one line per frame: pose and parameters (x) of the model, the 68 landmarks in px (also
/// those hidden or outside), and as extra fields "landmarks_visible" (0 or 1 each: inside the
/// picture and not hidden behind the head or a hand), "interocular_px" (distance of the outer eye
/// corners in the picture) and "in_picture" (at least half of the landmarks lie inside the frame).
/// Where the lips have markers, lips.csv says where the centres of the dots are, how they move, and
/// which can be seen ("seen"; "bridged": hidden by the lips, the head or a hand, or outside).
///
/// Throws InvalidInput for a model that cannot be dressed or a folder with other content. When
/// `progress` is cancelled, nothing is left behind and SolverError is thrown.
ClipFiles generate_clip(const FaceClipSpec& spec, const std::string& folder,
                        Progress& progress = silent_progress());

/// The files of a clip generated earlier. Throws InvalidInput if the folder holds none.
ClipFiles clip_files(const std::string& folder);

}  // namespace semblance
