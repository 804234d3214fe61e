#include "assignment.h"

#include <limits>

namespace semblance {

std::vector<int> assign(const Eigen::MatrixXd& cost) {
  const auto rows = static_cast<int>(cost.rows()), columns = static_cast<int>(cost.cols());
  std::vector<double> row_price(rows, 0.0), column_price(columns + 1, 0.0);
  std::vector<int> row_of(columns + 1, -1);  // the last column is where each path starts
  for (int row = 0; row < rows; ++row) {
    std::vector<double> least(columns + 1, std::numeric_limits<double>::infinity());
    std::vector<int> before(columns + 1, columns);
    std::vector<bool> visited(columns + 1, false);
    int at = columns;
    row_of[at] = row;
    while (row_of[at] >= 0) {
      visited[at] = true;
      int next = -1;
      for (int j = 0; j < columns; ++j) {
        if (visited[j]) continue;
        const double reduced = cost(row_of[at], j) - row_price[row_of[at]] - column_price[j];
        if (reduced < least[j]) {
          least[j] = reduced;
          before[j] = at;
        }
        if (next < 0 || least[j] < least[next]) next = j;
      }
      const double change = least[next];
      for (int j = 0; j <= columns; ++j) {
        if (visited[j]) {
          row_price[row_of[j]] += change;
          column_price[j] -= change;
        } else {
          least[j] -= change;
        }
      }
      at = next;
    }
    for (; at != columns; at = before[at]) row_of[at] = row_of[before[at]];
  }
  std::vector<int> column_of(rows, -1);
  for (int j = 0; j < columns; ++j) {
    if (row_of[j] >= 0) column_of[row_of[j]] = j;
  }
  return column_of;
}

}  // namespace semblance
