#include "semblance/geometry/scan_storage.h"

#include "semblance/core/errors.h"

namespace semblance {
namespace {

MeasuredTangent tangent_of(StorageMethod method) {
  switch (method) {
    case StorageMethod::null:
      return MeasuredTangent::null;
    case StorageMethod::one_sided:
      return MeasuredTangent::one_sided;
    default:
      return MeasuredTangent::averaged;
  }
}

/// RadialSweep::numbers_stored of so many contours.
std::int64_t numbers_of(const StorageOptions& options, std::int64_t contours,
                        std::int64_t columns) {
  const std::int64_t segments = contours - 1, averaged = 2 * contours * columns;
  switch (options.method) {
    case StorageMethod::null:
      return contours * columns;
    case StorageMethod::one_sided:
      return (contours + 2 * segments) * columns;
    case StorageMethod::fitted:
      return averaged + segments * (options.share == BlendShare::profile ? columns : 1);
    default:
      return averaged;
  }
}

std::vector<int> choose_rows(const RangeMap& map, const StorageOptions& options) {
  const auto row_count = static_cast<int>(map.rows());
  if (!options.budget_contours) return rows_every(row_count, options.every);
  const std::int64_t columns = map.columns(), limit = *options.budget_contours * columns;
  if (numbers_of(options, 2, columns) > limit) {
    throw InvalidInput("sweep: the numbers of " + std::to_string(*options.budget_contours) +
                       " contours are too few for two contours with what this method stores "
                       "beside them; raise the budget");
  }
  int contours = 2;
  while (contours < row_count && numbers_of(options, contours + 1, columns) <= limit) ++contours;
  return rows_equally(row_count, contours);
}

RadialSweep store_placed(const RangeMap& map, const StorageOptions& options) {
  const auto contours = options.budget_contours
                            ? static_cast<std::int64_t>(*options.budget_contours)
                            : static_cast<std::int64_t>(
                                  rows_every(static_cast<int>(map.rows()), options.every).size());
  PlacedSweepOptions placed;
  placed.numbers = contours * map.columns();
  placed.panel_columns = options.panel_columns;
  return sweep_placed(map, placed);
}

}  // namespace

RadialSweep store_scan(const RangeMap& map, const StorageOptions& options) {
  if (options.method == StorageMethod::full) return store_placed(map, options);
  RadialSweep sweep =
      sweep_measured(map, choose_rows(map, options), tangent_of(options.method), options.form,
                     options.method == StorageMethod::fitted ? 0.0 : options.n);
  if (options.method == StorageMethod::fitted) fit_blend(sweep, map, options.share);
  return sweep;
}

}  // namespace semblance
