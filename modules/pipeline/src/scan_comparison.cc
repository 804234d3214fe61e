#include "semblance/pipeline/scan_comparison.h"

#include <fmt/format.h>
#include <meshoptimizer.h>

#include <array>
#include <chrono>
#include <functional>

#include "semblance/geometry/cylindrical_scan.h"
#include "semblance/geometry/scan_storage.h"

namespace semblance {

namespace {

using Eigen::Index;

/// Four bytes per number: floats, and indices of meshes.
constexpr std::int64_t bytes_per_number = 4;

class Stopwatch {
 public:
  /// Seconds since the last call, or since the start.
  double lap_s() {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - start_).count();
    start_ = now;
    return seconds;
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

ScanComparison stored_sweep(const std::string& method, std::int64_t budget, const RangeMap& map,
                            const std::function<RadialSweep()>& make) {
  ScanComparison row;
  row.method = method;
  row.budget_numbers = budget;
  Stopwatch watch;
  const RadialSweep sweep = make();
  row.store_s = watch.lap_s();
  const Grid radii = sweep_radii(sweep);
  row.restore_s = watch.lap_s();
  row.numbers = sweep.numbers_stored;
  row.contours = sweep.mean_contours();
  row.error = radial_error(map, radii);
  return row;
}

/// Coordinates and corners.
std::int64_t numbers_of(const Mesh& mesh) {
  return 3 * static_cast<std::int64_t>(mesh.vertex_count() + mesh.triangle_count());
}

Mesh without_unused_vertices(const Mesh& mesh) {
  std::vector<int> place(static_cast<std::size_t>(mesh.vertex_count()), -1);
  Mesh result;
  result.positions_m.resize(mesh.vertex_count(), 3);
  result.triangles = mesh.triangles;
  int used = 0;
  for (int& corner : result.triangles.reshaped()) {
    int& target = place[static_cast<std::size_t>(corner)];
    if (target < 0) {
      target = used;
      result.positions_m.row(used++) = mesh.positions_m.row(corner);
    }
    corner = target;
  }
  result.positions_m.conservativeResize(used, 3);
  return result;
}

/// Quadric edge collapse (Garland and Heckbert 1997) onto vertices of the mesh.
Mesh decimate(const Mesh& mesh, Index triangles) {
  const PointsF points = mesh.positions_m.cast<float>();
  std::vector<unsigned> from(static_cast<std::size_t>(mesh.triangles.size())), to(from.size());
  std::copy_n(mesh.triangles.data(), from.size(), from.begin());
  constexpr float any_error = 1e9f;
  const std::size_t kept = meshopt_simplify(
      to.data(), from.data(), from.size(), points.data(), static_cast<std::size_t>(points.rows()),
      3 * sizeof(float), static_cast<std::size_t>(3 * triangles), any_error, 0, nullptr);
  Mesh result;
  result.positions_m = mesh.positions_m;
  result.triangles.resize(static_cast<Index>(kept) / 3, 3);
  std::copy_n(to.begin(), kept, result.triangles.data());
  return without_unused_vertices(result);
}

/// The decimated mesh with the most triangles within the budget.
Mesh decimate_within(const Mesh& mesh, std::int64_t numbers) {
  Mesh best;
  Index low = 0, high = mesh.triangle_count();
  while (low < high) {
    const Index middle = (low + high + 1) / 2;
    Mesh trial = decimate(mesh, middle);
    if (numbers_of(trial) <= numbers) {
      low = middle;
      best = std::move(trial);
    } else {
      high = middle - 1;
    }
  }
  return best;
}

/// The mesh's vertices joined where files double them, without texture coordinates.
Mesh welded(const Mesh& mesh) {
  const PointsF points = mesh.positions_m.cast<float>();
  std::vector<unsigned> target(static_cast<std::size_t>(points.rows()));
  meshopt_generateVertexRemap(target.data(), nullptr, target.size(), points.data(), target.size(),
                              3 * sizeof(float));
  Mesh result;
  result.positions_m = mesh.positions_m;
  for (std::size_t i = 0; i < target.size(); ++i) {
    result.positions_m.row(target[i]) = mesh.positions_m.row(static_cast<Index>(i));
  }
  result.triangles = mesh.triangles.unaryExpr(
      [&](int corner) { return static_cast<int>(target[static_cast<std::size_t>(corner)]); });
  return without_unused_vertices(result);
}

ScanComparison stored_mesh(std::int64_t budget, const RangeMap& map, const Mesh& mesh) {
  ScanComparison row;
  row.method = "triangle mesh, decimated";
  row.budget_numbers = budget;
  Stopwatch watch;
  const Mesh small = decimate_within(mesh, budget);
  row.store_s = watch.lap_s();
  row.numbers = numbers_of(small);
  RangeMap seen = scan_like(small, map);
  fill_voids(seen);  // where the coarser mesh is missed
  row.restore_s = watch.lap_s();
  row.error = radial_error(map, seen.radius_m);
  return row;
}

/// The sweeps with whole contours that the report knows, and their kin.
void add_measured(const RangeMap& map, int contours, std::vector<ScanComparison>& rows) {
  StorageOptions options;
  options.budget_contours = contours;
  const std::int64_t budget = contours * static_cast<std::int64_t>(map.columns());
  const auto add = [&](const std::string& name, StorageMethod method) {
    options.method = method;
    rows.push_back(stored_sweep(name, budget, map, [&] { return store_scan(map, options); }));
  };
  options.form = SweepForm::single_scaling;
  add("sweep, null scaling", StorageMethod::null);
  add("one scaling, one-sided tangents", StorageMethod::one_sided);
  add("one scaling, averaged", StorageMethod::averaged);
  options.share = BlendShare::profile;
  add("one scaling, n per profile", StorageMethod::fitted);
  options.form = SweepForm::double_scaling;
  add("two scalings, one-sided tangents", StorageMethod::one_sided);
  add("two scalings, averaged", StorageMethod::averaged);
  add("two scalings, n per profile", StorageMethod::fitted);
}

void add_budget(const RangeMap& map, const Mesh& mesh, int contours,
                std::vector<ScanComparison>& rows) {
  const std::int64_t budget = contours * static_cast<std::int64_t>(map.columns());
  const auto add = [&](const std::string& method, const std::function<RadialSweep()>& make) {
    rows.push_back(stored_sweep(method, budget, map, make));
  };
  const std::vector<int> equally = rows_equally(static_cast<int>(map.rows()), contours);
  constexpr std::array splines{SlopeRule::natural, SlopeRule::catmull_rom, SlopeRule::monotone};
  for (const SlopeRule rule : splines) {
    add(slope_rule_name(rule), [&] { return sweep_spline(map, equally, rule); });
  }
  add_measured(map, contours, rows);
  PlacedSweepOptions placed;
  placed.numbers = budget;
  add("full method", [&] { return sweep_placed(map, placed); });
  placed.fit = false;
  add("placed, Akima's tangents, n = 0", [&] { return sweep_placed(map, placed); });
  for (const SlopeRule rule : splines) {
    add(slope_rule_name(rule) + ", placed",
        [&] { return sweep_spline(sweep_placed(map, placed), rule); });
  }
  rows.push_back(stored_mesh(budget, map, mesh));
}

}  // namespace

std::vector<ScanComparison> compare_stored_scans(const RangeMap& map, const Mesh& mesh,
                                                 const std::vector<int>& budgets_contours) {
  const Mesh joined = welded(mesh);
  std::vector<ScanComparison> rows;
  for (const int contours : budgets_contours) {
    add_budget(map, joined, contours, rows);
  }
  return rows;
}

std::string comparison_table(const std::vector<ScanComparison>& rows) {
  std::string text = fmt::format("{:<36}{:>9}{:>9}{:>8}{:>9}{:>9}{:>9}{:>9}{:>10}{:>11}\n",
                                 "method", "numbers", "bytes", "rows", "mean mm", "rms mm",
                                 "95 % mm", "max mm", "store ms", "restore ms");
  std::int64_t budget = 0;
  for (const ScanComparison& row : rows) {
    if (row.budget_numbers != budget) {
      budget = row.budget_numbers;
      text += fmt::format("at most {} numbers\n", budget);
    }
    text += fmt::format(
        "  {:<34}{:>9}{:>9}{:>8.1f}{:>9.4f}{:>9.4f}{:>9.4f}{:>9.3f}{:>10.1f}"
        "{:>11.2f}\n",
        row.method, row.numbers, bytes_per_number * row.numbers, row.contours,
        1e3 * row.error.mean_m, 1e3 * row.error.rms_m, 1e3 * row.error.percentile95_m,
        1e3 * row.error.largest_m, 1e3 * row.store_s, 1e3 * row.restore_s);
  }
  return text;
}

}  // namespace semblance
