#include "placement.h"

#include <algorithm>
#include <limits>

namespace semblance {

SegmentCosts::SegmentCosts(int rows, int longest)
    : rows_(rows),
      longest_(std::min(longest, rows - 1)),
      costs_(static_cast<std::size_t>(rows_) * longest_) {}

std::vector<int> place_contours(const SegmentCosts& costs, double price) {
  const int rows = costs.rows();
  std::vector<double> best(rows, std::numeric_limits<double>::infinity());
  std::vector<int> before(rows, 0);
  best[0] = price;
  for (int last = 1; last < rows; ++last) {
    for (int first = std::max(0, last - costs.longest()); first < last; ++first) {
      const double cost = best[first] + costs.at(first, last) + price;
      if (cost < best[last]) {
        best[last] = cost;
        before[last] = first;
      }
    }
  }
  std::vector<int> placed{rows - 1};
  while (placed.back() != 0) placed.push_back(before[placed.back()]);
  std::reverse(placed.begin(), placed.end());
  return placed;
}

}  // namespace semblance
