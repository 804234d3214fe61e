// Figures of a set of errors.
#pragma once

#include <vector>

#include "semblance/synth/score.h"

namespace semblance {

/// Linear between ranks; NaN of nothing.
double quantile(std::vector<double> values, double share);
Spread spread(const std::vector<double>& values);

}  // namespace semblance
