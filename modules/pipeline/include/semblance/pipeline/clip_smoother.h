// All frames of a clip at once: the whole-clip solve in both directions.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "semblance/core/progress.h"
#include "semblance/optim/objective.h"

namespace semblance {

/// What is known of one frame: the Gauss-Newton model of its own cost around x, or nothing.
struct ClipFrame {
  Eigen::VectorXd x;                     // full parameter vector; ignored where the frame was lost
  std::optional<NormalEquations> model;  // absent: lost
};

struct ClipSmootherOptions {
  /// For each tangent entry, the standard deviation of its second difference over three frames in a
  /// row (change of velocity per frame interval), in the unit of the entry (radian for rotations);
  /// infinite: not coupled in time. Entries of shared blocks are ignored.
  Eigen::VectorXd acceleration_sigma;
  /// Blocks with one value for the whole clip (identity). Euclidean only.
  std::vector<int> shared_blocks;
  /// Lost frames in a row that are bridged; at a longer gap the chain is cut and they stay lost.
  int longest_bridge = 5;
};

/// How a frame came out: from its own data and its neighbours', from its neighbours' alone, or not.
enum class SmoothedState { smoothed, bridged, lost };

struct SmoothedFrame {
  SmoothedState state = SmoothedState::lost;
  Eigen::VectorXd x;      // empty where lost
  Eigen::VectorXd sigma;  // standard deviation of each tangent entry; empty where lost
};

struct SmoothedClip {
  std::vector<SmoothedFrame> frames;
  /// Sum of the frames' models and of the temporal terms, at the given x and after.
  double cost_before = 0.0, cost_after = 0.0;
  /// Largest move of any entry from its linearisation point, in units of tangent_scale(): the
  /// caller linearises anew and calls again until it is small.
  double largest_move = 0.0;
  bool converged = false;  // false when cancelled or out of iterations
};

/// Minimises, over the moves d_f of all frames together,
///   sum_f gradient_f'd_f + d_f'hessian_f d_f / 2 + sum_{f, i} ((a_f)_i / acceleration_sigma_i)^2 /
///   2
/// within the bounds, where a_f is the second difference around frame f; for a rotation it is the
/// difference of the two successive rotation vectors log(q_{f+1} q_f^-1). This is the maximum a
/// posteriori path of a constant-velocity model, a Rauch-Tung-Striebel smoother on the manifold
/// with shared parameters, solved with Ceres. `sigma` comes from the inverse Hessian of the whole
/// clip, bounds not regarded, by block elimination and its reversal (Takahashi, Fagan and Chin
/// 1973); a direction that nothing determines ends at a thousand times tangent_scale().
/// Throws InvalidInput for sizes that do not fit, values that are not finite, a sigma that is not
/// positive, or a shared rotation.
SmoothedClip smooth_clip(const ParameterSpace& space, const std::vector<ClipFrame>& frames,
                         const ClipSmootherOptions& options, Progress& progress);

}  // namespace semblance
