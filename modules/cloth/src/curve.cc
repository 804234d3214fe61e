#include "semblance/cloth/curve.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "semblance/core/errors.h"
#include "semblance/geometry/contour_slopes.h"

namespace semblance {
namespace {

void check(const std::vector<double>& x, const std::vector<double>& values) {
  if (x.size() < 2 || x.size() != values.size()) {
    throw InvalidInput(fmt::format(
        "a curve needs two points at least, and as many values as places; got {} and {}",
        values.size(), x.size()));
  }
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!std::isfinite(x[i]) || !std::isfinite(values[i])) {
      throw InvalidInput(fmt::format("point {} of a curve is not finite", i + 1));
    }
    if (i == 0 ? x[0] < 0.0 : x[i] <= x[i - 1]) {
      throw InvalidInput(fmt::format(
          "point {} of a curve lies at {:g}: places must increase from 0 or above", i + 1, x[i]));
    }
  }
}

}  // namespace

Curve::Curve(std::vector<double> x, std::vector<double> values, Beyond beyond)
    : x_(std::move(x)), values_(std::move(values)), beyond_(beyond) {
  check(x_, values_);
  make_pieces();
  integrate_pieces();
  fill_table();
}

void Curve::make_pieces() {
  const Eigen::ArrayXd slopes = curve_slopes(x_, values_, SlopeRule::monotone);
  const bool tangents = beyond_ == Beyond::linear;
  const std::size_t last = x_.size() - 1;
  pieces_.push_back({x_[0], {values_[0], tangents ? slopes[0] : 0.0, 0.0, 0.0}, 0.0});
  for (std::size_t i = 0; i < last; ++i) {
    const double h = x_[i + 1] - x_[i], chord = (values_[i + 1] - values_[i]) / h;
    const double a = slopes[static_cast<Eigen::Index>(i)];
    const double b = slopes[static_cast<Eigen::Index>(i + 1)];
    pieces_.push_back(
        {x_[i], {values_[i], a, (3.0 * chord - 2.0 * a - b) / h, (a + b - 2.0 * chord) / (h * h)}});
  }
  const double end = tangents ? slopes[static_cast<Eigen::Index>(last)] : 0.0;
  pieces_.push_back({x_[last], {values_[last], end, 0.0, 0.0}});
  pieces_.push_back({std::numeric_limits<double>::quiet_NaN()});
}

void Curve::integrate_pieces() {
  const auto integral = [](const Piece& piece, double t) {
    const double* const c = piece.coefficient;
    return t * (c[0] + t * (c[1] / 2.0 + t * (c[2] / 3.0 + t * c[3] / 4.0)));
  };
  pieces_[0].integral = -integral(pieces_[0], -x_[0]);
  pieces_[1].integral = pieces_[0].integral;
  for (std::size_t i = 2; i + 1 < pieces_.size(); ++i) {
    const Piece& before = pieces_[i - 1];
    pieces_[i].integral = before.integral + integral(before, pieces_[i].start - before.start);
  }
}

void Curve::fill_table() {
  const std::size_t cells = 4 * (x_.size() - 1);
  first_ = x_.front();
  cells_per_x_ = static_cast<double>(cells) / (x_.back() - first_);
  last_cell_ = static_cast<double>(cells + 1);
  // Before the first cell lies one for all before the first point, and behind the last one
  // likewise.
  std::uint32_t piece = 0;
  for (std::size_t cell = 0; cell < cells + 2; ++cell) {
    // A little early: rounding may put a place just below a point into the cell that begins there.
    const double start = first_ + (static_cast<double>(cell) - 1.0 - 1e-6) / cells_per_x_;
    while (start >= pieces_[piece + 1].start) ++piece;
    table_.push_back(piece);
  }
}

std::vector<double> common_places(const Curve& a, const Curve& b) {
  std::vector<double> places;
  std::merge(a.x().begin(), a.x().end(), b.x().begin(), b.x().end(), std::back_inserter(places));
  // Places that differ by rounding only would make steps of their values' differences.
  const double least = 1e-9 * places.back();
  const auto same = [&](double low, double high) { return high - low < least; };
  places.erase(std::unique(places.begin(), places.end(), same), places.end());
  return places;
}

Curve mean_curve(const Curve& a, const Curve& b) {
  const std::vector<double> x = common_places(a, b);
  std::vector<double> values;
  for (const double place : x) values.push_back(0.5 * (a.value(place) + b.value(place)));
  return {x, values, a.beyond()};
}

}  // namespace semblance
