// Comparison of the drawn mesh with the pictures, from coarse to fine.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "object_covariance.h"
#include "object_objective.h"
#include "semblance/cost/observation.h"
#include "semblance/cost/photometric.h"

namespace semblance {

/// Where the refinement stands. Poses are of the target's middle.
struct RefinementState {
  Camera camera;
  std::vector<Rigid3> poses;
};

/// Draws, compares and moves, in rounds: each finds edges for the outline and the light anew, and
/// then minimises over all pictures at once.
class ObjectRefinement {
 public:
  ObjectRefinement(const ObjectTarget& target, const std::vector<ObjectPicture>& pictures,
                   const IntrinsicsFreedom& freedom, double pair_sigma_px,
                   const std::function<bool()>& cancelled);
  ~ObjectRefinement();

  /// Throws SolverError naming the pictures in which the object is not seen or not found.
  RefinementState run(const RefinementState& start);
  /// Of the last run: in the tangent space of the free intrinsics and all poses.
  std::optional<Eigen::MatrixXd> covariance() const { return covariance_; }
  const std::vector<ObjectFit>& fits() const { return fits_; }
  int rounds() const { return rounds_; }

 private:
  struct View;
  struct Solved {
    RefinementState state;
    double motion_px = 0.0;  // the farthest that a place of the mesh moved in a picture
  };
  PhotometricCost::Statistics facts(const View& view, int stage, const Synthesis& synthesis) const;
  ObjectObjective probe(const RefinementState& state, int stage) const;
  void look(const RefinementState& state, int stage);
  ObjectObjective comparison(const RefinementState& state, int stage) const;
  Solved solve(const RefinementState& state, int stage) const;
  void finish(const RefinementState& state);
  void check_found() const;

  const ObjectTarget& target_;
  const std::vector<ObjectPicture>& pictures_;
  IntrinsicsFreedom freedom_;
  double pair_sigma_px_;
  const std::function<bool()>& cancelled_;
  ObjectWorkspace workspace_;
  std::vector<ContourEdge> edges_;
  std::vector<float> triangle_weight_;
  std::vector<std::unique_ptr<View>> views_;
  std::vector<ObjectFit> fits_;
  std::optional<Eigen::MatrixXd> covariance_;
  int rounds_ = 0;
};

}  // namespace semblance
