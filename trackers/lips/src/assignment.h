// The assignment problem.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace semblance {

/// The column of each row such that the sum of their costs is least and no column is taken twice
/// (Kuhn 1955, "The Hungarian method for the assignment problem", by shortest augmenting paths). At
/// least as many columns as rows; finite costs.
std::vector<int> assign(const Eigen::MatrixXd& cost);

}  // namespace semblance
