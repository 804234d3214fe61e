// How certain the refined estimate is.
#pragma once

#include <optional>
#include <vector>

#include "colour_comparison.h"
#include "object_objective.h"
#include "outline_comparison.h"

namespace semblance {

/// The comparisons of one picture, to be taken apart into cells.
struct PictureComparison {
  const ColourComparison* colours = nullptr;  // may be null
  const OutlineComparison* outline = nullptr;
};

/// Covariance at x in the objective's tangent space; none where the Hessian is singular.
///
/// The scatter of the gradient is summed over cells of each picture. Two more terms join it: the
/// pairs, by their deviation, for they are few; and what all of an outline or of the colours gets
/// wrong alike, which no scatter shows.
std::optional<Eigen::MatrixXd> comparison_covariance(
    const ObjectObjective& objective, const Eigen::VectorXd& x,
    const std::vector<PictureComparison>& comparisons);

/// The inverse by scaled Cholesky factors; none where the matrix is singular to working precision.
std::optional<Eigen::MatrixXd> inverse_of_normal(const Eigen::MatrixXd& hessian);

}  // namespace semblance
