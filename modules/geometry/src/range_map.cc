#include "semblance/geometry/range_map.h"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <cmath>
#include <numbers>
#include <vector>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Index;

constexpr double pi = std::numbers::pi;

[[noreturn]] void fail(const std::string& source, const std::string& what) {
  throw InvalidInput(source + ": " + what);
}

std::string size_text(Index rows, Index columns) {
  return std::to_string(rows) + " x " + std::to_string(columns);
}

void check_size(const RangeMap& map, const std::string& source) {
  const Index most = most_range_samples_per_side;
  if (map.rows() < fewest_range_rows || map.columns() < fewest_range_columns || map.rows() > most ||
      map.columns() > most) {
    fail(source, "the range map has " + size_text(map.rows(), map.columns()) +
                     " rows and columns; from 2 x 3 to 8192 x 8192 were expected");
  }
  if (map.samples.rows() != map.rows() || map.samples.cols() != map.columns()) {
    fail(source, "radii and marks of the range map differ in size: " +
                     size_text(map.rows(), map.columns()) + " and " +
                     size_text(map.samples.rows(), map.samples.cols()));
  }
}

/// Numbers the void samples row by row; -1 for the others.
Eigen::Array<int, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> number_voids(const RangeMap& map,
                                                                                int& count) {
  Eigen::Array<int, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> number(map.rows(),
                                                                            map.columns());
  count = 0;
  for (Index i = 0; i < number.size(); ++i) {
    number.data()[i] = map.samples.data()[i] == RangeSample::none ? count++ : -1;
  }
  return number;
}

}  // namespace

double RangeMap::column_angle_rad(Index column) const {
  return 2.0 * pi * (static_cast<double>(column) + 0.5) / static_cast<double>(columns()) - pi;
}

Eigen::Vector3d RangeMap::point(Index row, Index column) const {
  const double a = column_angle_rad(column), r = radius_m(row, column);
  return world_from_map * Eigen::Vector3d(r * std::sin(a), height_m(row), r * std::cos(a));
}

void validate(const RangeMap& map, const std::string& source) {
  check_size(map, source);
  if (!(map.spacing_m > 0.0) || !std::isfinite(map.spacing_m) || !std::isfinite(map.bottom_m)) {
    fail(source, "the range map needs a finite lowest height and a positive spacing of its rows");
  }
  bool measured = false;
  for (Index row = 0; row < map.rows(); ++row) {
    for (Index column = 0; column < map.columns(); ++column) {
      const RangeSample sample = map.samples(row, column);
      if (sample == RangeSample::none) continue;
      measured = measured || sample == RangeSample::measured;
      const float radius = map.radius_m(row, column);
      if (!(radius > 0.0f) || !std::isfinite(radius)) {
        fail(source, "the sample in row " + std::to_string(row) + " and column " +
                         std::to_string(column) + " has the radius " + std::to_string(radius) +
                         "; mark it as void or give it a finite positive one");
      }
    }
  }
  if (!measured) {
    fail(source,
         "no sample of the range map is measured; scan again with an axis inside the object");
  }
}

void fill_voids(RangeMap& map) {
  validate(map, "void filling");
  int count = 0;
  const auto number = number_voids(map, count);
  if (count == 0) return;
  // Finite differences with the true ratio of a sample's width to its height.
  const double width_m = 2.0 * pi * mean_radius_m(map) / static_cast<double>(map.columns());
  const double across = 1.0, along = width_m * width_m / (map.spacing_m * map.spacing_m);
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::VectorXd right = Eigen::VectorXd::Zero(count);
  for (Index row = 0; row < map.rows(); ++row) {
    for (Index column = 0; column < map.columns(); ++column) {
      const int self = number(row, column);
      if (self < 0) continue;
      const auto couple = [&](Index r, Index c, double weight) {
        if (r < 0 || r >= map.rows()) return;
        entries.emplace_back(self, self, weight);
        if (number(r, c) < 0) {
          right[self] += weight * map.radius_m(r, c);
        } else {
          entries.emplace_back(self, number(r, c), -weight);
        }
      };
      couple(row, (column + 1) % map.columns(), across);
      couple(row, (column + map.columns() - 1) % map.columns(), across);
      couple(row - 1, column, along);
      couple(row + 1, column, along);
    }
  }
  Eigen::SparseMatrix<double> matrix(count, count);
  matrix.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
  const Eigen::VectorXd solution = solver.solve(right);
  for (Index i = 0; i < number.size(); ++i) {
    const int self = number.data()[i];
    if (self < 0) continue;
    map.radius_m.data()[i] = static_cast<float>(solution[self]);
    map.samples.data()[i] = RangeSample::filled;
  }
}

double mean_radius_m(const RangeMap& map) {
  const auto measured = (map.samples == RangeSample::measured).cast<double>();
  return (map.radius_m.cast<double>() * measured).sum() / measured.sum();
}

Mesh mesh_from_range_map(const RangeMap& map) {
  Mesh mesh;
  int count = 0;
  std::vector<int> vertex(static_cast<std::size_t>(map.radius_m.size()), -1);
  for (Index i = 0; i < map.samples.size(); ++i) {
    if (map.samples.data()[i] != RangeSample::none) vertex[static_cast<std::size_t>(i)] = count++;
  }
  mesh.positions_m.resize(count, 3);
  std::vector<Eigen::Vector3i> triangles;
  const auto add = [&](int a, int b, int c) {
    if (a >= 0 && b >= 0 && c >= 0) triangles.emplace_back(a, b, c);
  };
  for (Index row = 0; row < map.rows(); ++row) {
    for (Index column = 0; column < map.columns(); ++column) {
      const auto at = [&](Index r, Index c) {
        return vertex[static_cast<std::size_t>(r * map.columns() + c % map.columns())];
      };
      const int here = at(row, column);
      if (here >= 0) mesh.positions_m.row(here) = map.point(row, column);
      if (row + 1 == map.rows()) continue;
      const int right = at(row, column + 1), above = at(row + 1, column),
                across = at(row + 1, column + 1);
      add(here, right, across);
      add(here, across, above);
    }
  }
  mesh.triangles.resize(static_cast<Index>(triangles.size()), 3);
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    mesh.triangles.row(static_cast<Index>(i)) = triangles[i];
  }
  return mesh;
}

}  // namespace semblance
