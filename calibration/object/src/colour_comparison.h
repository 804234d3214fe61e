// The mesh's colours under an estimated light, against a picture's.
#pragma once

#include <vector>

#include "object_objective.h"
#include "semblance/cost/observation.h"

namespace semblance {

/// Residual per visible pixel and channel: encode(albedo * light) - encode(observed), as in
/// PhotometricCost. Three things are taken into account here that tracking may leave out, because a
/// textured face hardly feels them: a surface that turns shows other normals to the light, and the
/// light, which is not known either, can take up part of what a motion does. Without them, a plain
/// ball's turn would seem to be visible. The third: nine functions of the normal do not hold a
/// lamp, let alone its shadows. What they miss is smooth and multiplies colours, and pulls a
/// texture's outer parts all one way (a focal length came out 0.6 % short); a gain per small block
/// of the picture takes it up.
///
/// The gains and the light's 27 coefficients are eliminated from the equations by Schur
/// complements, and the cost is that after their own Gauss-Newton step (variable projection: Golub
/// and Pereyra, SIAM J. Numer. Anal. 10, 1973).
class ColourComparison {
 public:
  struct Options {
    double sigma = 0.03;        // of an inlier's residual, encoded intensity
    double robust_width = 3.0;  // Geman-McClure
    double correlation_area_px = 8.0;
    double reference_pixels = 0.0;  // the cost is the pixels' mean times this
    int texture_level = 0;
  };
  ColourComparison(const ObjectTarget& target, const ObservationLevel& observation,
                   const Options& options)
      : target_(target), observation_(observation), options_(options) {}

  /// The cost; adds the equations of the intrinsics and the pose to `out` unless it is null.
  double evaluate(const PictureView& view, const Synthesis& synthesis, NormalEquations* out) const;

  /// Gradients by parts of the picture: columns are cells. `cell` has one entry per visible pixel.
  /// The last columns are those of displacements of all the picture by `systematic_px`: shifts,
  /// scale, turn, and bends of second order.
  struct Scores {
    Eigen::MatrixXd cells, systematic;
  };
  Scores scores(const PictureView& view, const Synthesis& synthesis, const std::vector<int>& cell,
                int cells, double systematic_px) const;

 private:
  struct Mean {
    double cost, weights;
  };
  Eigen::Index blocks() const;  // of the picture, a gain each
  std::size_t block_of(int pixel) const;
  template <class Use>
  Mean for_each_pixel(const PictureView& view, const Synthesis& synthesis, bool derivatives,
                      const Use& use) const;
  const ObjectTarget& target_;
  const ObservationLevel& observation_;
  Options options_;
};

}  // namespace semblance
