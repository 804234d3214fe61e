// Where contours go: shortest paths over the rows.
#pragma once

#include <vector>

namespace semblance {

/// Errors of the segments between any two rows at most `longest` apart.
class SegmentCosts {
 public:
  SegmentCosts(int rows, int longest);
  int rows() const { return rows_; }
  int longest() const { return longest_; }
  double& at(int first, int last) { return costs_[index(first, last)]; }
  double at(int first, int last) const { return costs_[index(first, last)]; }

 private:
  std::size_t index(int first, int last) const {
    return static_cast<std::size_t>(first) * longest_ + (last - first - 1);
  }
  int rows_, longest_;
  std::vector<double> costs_;
};

/// The rows, first and last included, that minimise the sum of the segments' costs plus `price` per
/// contour. No other choice of as many contours has a smaller sum of costs.
std::vector<int> place_contours(const SegmentCosts& costs, double price);

}  // namespace semblance
