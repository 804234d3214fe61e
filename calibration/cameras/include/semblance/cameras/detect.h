// Finds the points of calibration sheets in pictures.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "semblance/cameras/target.h"
#include "semblance/io/video.h"

namespace semblance {

/// What a person should know about a detection. `text` says it in words and what to do about it.
struct DetectionWarning {
  /// mirrored          the picture shows the sheet's mirror image; no point is matched
  /// wrong_counts      a whole sheet of the kind is seen, but with other counts
  /// incomplete        a sheet that needs all of its points to name them is seen in part
  /// half_turn         the sheet looks the same after half a turn: which end is up was assumed
  /// unknown_size      the size of an `auto` sheet is not known: its text says 1 m
  /// assumed_counts    an `auto` sheet was not seen to its ends: it may have more columns or rows
  enum class Kind { mirrored, wrong_counts, incomplete, half_turn, unknown_size, assumed_counts };
  Kind kind;
  std::string text;
};

/// The name of a kind of warning, as in "wrong_counts".
const char* warning_name(DetectionWarning::Kind kind);

/// Points of one sheet in one picture. Their deviations are not known here: they follow from the
/// residuals of whoever fits a camera to them.
struct Detection {
  Target target;               // the sheet; automatic where none was recognised
  std::vector<int> ids;        // of `target` (point_ids), ascending
  Eigen::Matrix2Xd points_px;  // one column for each id; pixel centres at +0.5
  /// Of circles and dots, for each id: of the circle of equal area. Empty for other sheets.
  std::vector<double> radii_px;
  int width = 0, height = 0;  // of the picture
  bool inverted = false;      // printed white on black (ChArUco)
  std::vector<DetectionWarning> warnings;

  bool found() const { return !ids.empty(); }
};

/// Detects sheets, one picture after another. Keeps tables between pictures, so that one detector
/// should serve a whole video; one thread at a time.
///
/// Tags and markers: AprilTag's and OpenCV's detectors; sheets may be seen in part. A marker counts
/// where its neighbours on the sheet agree with it, so that false readings do not pass. Points that
/// are missing are searched where their neighbours predict them, which follows any smooth
/// distortion. Chessboards: saddle points, joined to a lattice from neighbour to neighbour; all of
/// the corners must be seen. Corners are refined by OpenCV's cornerSubPix in a window that fits the
/// sheet. Circles and dots: dual conics through the gradients at their outlines (Ouellet and
/// Hebert, "Precise ellipse estimation without contour point extraction", Machine Vision and
/// Applications 21, 2009). The centre of an ellipse is not quite the image of the circle's centre;
/// for a circle of radius r px seen at an angle the two differ by less than r^2 / focal_px.
/// Calibrations correct it by the radii.
class Detector {
 public:
  /// Throws InvalidInput where the sheet is not one of `parse_target`'s.
  explicit Detector(const Target& target);
  ~Detector();
  Detector(Detector&&) noexcept;

  Detection detect(const Rgb8& image);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// One picture. For `auto` the sheet is identified in this picture alone.
Detection detect(const Rgb8& image, const Target& target);

/// The sheet that most of the pictures show, with the largest counts seen; automatic where none is
/// recognised. A size that is not known becomes 1 m.
Target identify_target(const std::vector<Rgb8>& images, const Target& automatic);

}  // namespace semblance
