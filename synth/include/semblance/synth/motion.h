// The parameters of a talking, turning head over time.
#pragma once

#include <Eigen/Core>
#include <memory>

#include "semblance/models/morph_model.h"
#include "semblance/synth/clip_spec.h"

namespace semblance {

/// Parameters of a MorphModel as a smooth function of time, all drawn from the clip's seed.
///
/// Identity: the leading parameters are drawn from their prior, scaled by LookSpec. Speech: a
/// sequence of syllables (consonant, vowel) grouped in phrases, whose mouth shapes are blended by
/// dominance functions (Cohen and Massaro 1993, "Modeling coarticulation in synthetic visual
/// speech", equation 1, with a Gaussian fall-off). Blinks every 2 to 6 s with a fast closing and a
/// slower opening; saccades; gaze that stays at the camera while the head turns. Expression
/// parameters are found by ARKit's names in any spelling (jawOpen, jaw_open, eyeBlink_L,
/// eye_blink_left); those a model lacks are left at rest.
class FaceMotion {
 public:
  FaceMotion(const FaceClipSpec& spec, const MorphModel& model);
  ~FaceMotion();
  FaceMotion(FaceMotion&&) noexcept;

  /// x of the model. The camera stands at the origin of the world and looks along -z.
  Eigen::VectorXd at(double time_s) const;
  /// How many of the model's expression parameters move.
  int driven_count() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace semblance
