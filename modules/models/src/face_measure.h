// The mean face and the spread of its measures.
#pragma once

#include "face_identity.h"

namespace semblance::face {

/// Coefficients at which every measure that has a published mean takes it, by Newton's method on
/// one measure after the other.
Identity mean_identity();

/// Coefficient of measure i for one standard deviation: its distance, or where it has none the peak
/// displacement, changes by the published deviation.
double coefficient_per_deviation(Eigen::Index i, const Identity& mean);

}  // namespace semblance::face
