// Fits the face model to one image from scratch.
#pragma once

#include <optional>
#include <vector>

#include "semblance/cost/photometric.h"
#include "semblance/face/face_detector.h"
#include "semblance/models/morph_model.h"
#include "semblance/optim/optimizer.h"
#include "semblance/pipeline/synthesis_objective.h"

namespace semblance {

/// Pose, shape and light of a face in one image.
struct FaceFit {
  Eigen::VectorXd x;  // of the model
  ShLight light;
  double cost = 0.0;
  PhotometricCost::Statistics statistics;  // at full resolution
};

/// Marks in the image, by landmark index of the model; entries without a mark are absent.
struct FaceMark {
  int landmark = 0;
  Eigen::Vector2d point_px;
  double sigma_px = 1.0;
};

/// Analysis by synthesis without a texture: each part of the face has a colour relative to the
/// skin, and the light is solved for in closed form, so that only the arrangement of brows, eyes,
/// nose and lips has to fit. A grid of poses around the detector's box is evaluated on a reduced
/// image, the best are refined by Gauss-Newton, and the winner is refined on finer images with
/// identity and expression.
class FaceFitter {
 public:
  explicit FaceFitter(const MorphModel& model);

  /// Throws SolverError if no start leads to a fit.
  FaceFit fit(const Observation& observation, const Camera& camera, const FaceBox& box) const;
  /// From marks: pose from them first, then everything. Needs four marks.
  FaceFit fit(const Observation& observation, const Camera& camera,
              const std::vector<FaceMark>& marks) const;

  /// The light under which the coloured face at x looks most like the image: ambient and direction.
  ShLight part_light(const Observation& observation, const Camera& camera,
                     const Eigen::VectorXd& x) const;
  /// Cost of the coloured face at x (its own light solved for) and of the marks, without priors;
  /// normal equations over all parameters of the model are added to `out` where it is not null.
  double compare_parts(const Observation& observation, const Camera& camera,
                       const Eigen::VectorXd& x, const std::vector<FaceMark>& marks,
                       NormalEquations* out) const;

  const SurfaceTopology& topology() const { return topology_; }
  /// The coloured face that is compared with the image.
  const Appearance& generic_appearance() const { return appearance_; }

 private:
  struct Stage {
    int level = 0;
    bool with_shape = false;
    double photometric_sigma = 0.1;
    int rounds = 2;
    int iterations = 6;
  };
  void refine(const Observation& observation, const Camera& camera, const Stage& stage,
              const Eigen::VectorXd& start, const FaceBox& detection,
              const std::vector<FaceMark>& marks, FaceFit& fit) const;
  FaceFit finish(const Observation& observation, const Camera& camera,
                 const Eigen::VectorXd& detected, const FaceBox& detection,
                 const std::vector<FaceMark>& marks, std::vector<FaceFit> starts,
                 int coarse_level) const;

  const MorphModel& model_;
  SurfaceTopology topology_;
  mutable SynthesisWorkspace workspace_;
  Appearance appearance_;
  std::vector<float> triangle_weight_;
  std::array<int, 2>
      pupil_triangle_;  // of the eye left in a frontal image, then right; -1: unknown
};

/// Pose block values for a face seen frontally, level, with its eyes' midpoint at `eyes_px` and the
/// given distance between the eyes in pixels.
void set_pose(const ParameterSpace& space, const Camera& camera, const Eigen::Vector2d& eyes_px,
              double eye_distance_px, const Eigen::Quaterniond& camera_rotation,
              Eigen::VectorXd& x);

}  // namespace semblance
