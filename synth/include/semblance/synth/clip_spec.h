// Recipes of synthetic face sequences: what one clip shows, and suites of clips as JSON files.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace semblance {

/// How the head moves. Angles are limits; the first frame is near frontal.
struct MotionSpec {
  double yaw_deg = 40.0;           ///< both directions are visited to at least 90 % of this
  double pitch_deg = 15.0;         ///< nodding, either direction
  double roll_deg = 10.0;          ///< tilting, either direction
  double distance_m = 0.6;         ///< mean distance of the head from the camera
  double distance_range_m = 0.1;   ///< largest approach and retreat
  double sideways_m = 0.05;        ///< largest shift of the head to any side
  double height_m = 0.0;           ///< mean height of the eyes above the camera's axis
  double peak_speed_deg_s = 90.0;  ///< fastest turn
  double sway = 1.0;               ///< strength of the always-present small movements; 0: none
  double syllables_per_s = 4.0;    ///< speech tempo, 3 to 5 in ordinary speech
  double expression = 1.0;         ///< strength of speech, brows, smiles; 0 leaves a still face
};

/// What passes in front of the face or takes it away; a span is empty where `to` <= `from`.
struct OcclusionSpec {
  double hand_from_s = 0.0, hand_to_s = 0.0;  ///< a hand is held before the mouth
  /// Finger tips are held before the half of the mouth that is left in the picture.
  double fingers_from_s = 0.0, fingers_to_s = 0.0;
  double leave_from_s = 0.0, leave_to_s = 0.0;  ///< the head leaves the picture sideways
};

/// Who is seen; everything not given here is drawn from the clip's seed.
struct LookSpec {
  double identity_sigma = 0.8;   ///< deviation of the drawn identity in units of the prior's
  int identity_parameters = 20;  ///< how many leading identity parameters are drawn
  double skin_tone = -1.0;       ///< 0 dark to 1 light (ColorChecker patches); negative: drawn
  double stubble = -1.0;         ///< 0 to 1; negative: drawn
  double key_light = 0.6;        ///< share of the directional light in the light on the face
  bool clutter = true;           ///< cluttered background with moving objects, else a plain wall
};

/// Dots painted on the lips of the neutral face (order: io/lip_markers.h).
struct MarkerSpec {
  int count = 0;               ///< 0, 8 (outer contour) or 16 (and inner)
  double diameter_m = 0.0025;  ///< of a dot, at most half the outer contour's spacing
  double red = 0.03, green = 0.1, blue = 0.35;  ///< linear albedo
};

/// The camera's imperfections.
struct SensorSpec {
  int samples = 4;            ///< rays per pixel and sub-frame: 1, 4 or 16
  double lens_blur_px = 0.6;  ///< deviation of a Gaussian
  int sub_frames = 1;         ///< instants averaged over the exposure: motion blur
  double exposure_s = 0.015;  ///< spread of the sub-frames, centred on the frame's time
  double noise_levels = 2.0;  ///< deviation of Gaussian noise in 8-bit grey levels
  double tone_gamma = 1.0;    ///< exponent on the sRGB-encoded value; 1 is a true sRGB camera
};

/// A clip: a talking, turning head before a background, with exact truth.
struct FaceClipSpec {
  std::string name = "clip";
  std::string model = "builtin";  ///< "builtin", a path for load_face, or "data:PATH" below the
                                  ///< folder that the environment variable SEMBLANCE_DATA names
  double density = 1.6;           ///< tessellation of the built-in face
  std::uint64_t seed = 1;
  int frames = 100;
  double frames_per_second = 25.0;
  int width = 640, height = 480;
  double focal_px = 600.0;
  std::string output = "png";  ///< "png": folder of lossless images; "mp4": H.264; "avi": MJPG
  MotionSpec motion;
  OcclusionSpec occlusion;
  LookSpec look;
  MarkerSpec markers;
  SensorSpec sensor;
};

/// A named set of clips (semblance.suite/1, docs/synth.md).
struct SynthSuite {
  std::string name;
  std::string about;
  bool same_model = false;  ///< generated with the tracker's own model: a sanity floor, no claim
  std::vector<FaceClipSpec> clips;
};

/// Reads a recipe: a suite.json or the folder that holds one. Throws InvalidInput naming file and
/// key for anything missing, unknown, of the wrong type or out of range.
SynthSuite read_suite(const std::string& path);

/// One clip's recipe as JSON text with every key, as `generate_clip` writes it beside the clip.
std::string clip_spec_json(const FaceClipSpec& spec);

/// `model` as load_face takes it: "data:PATH" resolved. Throws InvalidInput if SEMBLANCE_DATA is
/// not set though needed.
std::string resolve_model(const FaceClipSpec& spec);

}  // namespace semblance
