// Measured curves as smooth functions with slope and integral.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace semblance {

/// What a curve is at one place.
struct CurvePoint {
  double value = 0.0;
  double slope = 0.0;
  double integral = 0.0;  ///< of the value from 0 to the place
};

/// A shape-preserving piecewise cubic through measured points: Hermite's cubics with the slopes of
/// Fritsch and Butland (SIAM J. Sci. Stat. Comput. 5, 1984), so that it rises and falls only where
/// the points do, and with one continuous derivative. Units are the caller's.
class Curve {
 public:
  /// How it goes on before the first and behind the last point.
  enum class Beyond {
    linear,    ///< along the tangents there
    constant,  ///< with the values there
  };

  /// Zero everywhere.
  Curve() : Curve(linear(0.0, 1.0)) {}
  /// Through (x[i], values[i]). Throws InvalidInput unless there are two points at least and all
  /// are finite with 0 <= x[0] < x[1] < ...
  Curve(std::vector<double> x, std::vector<double> values, Beyond beyond = Beyond::linear);
  /// slope * x, with points at 0 and `end`.
  static Curve linear(double slope, double end) { return {{0.0, end}, {0.0, slope * end}}; }
  /// `value` everywhere, with points at 0 and `end`.
  static Curve constant(double value, double end) {
    return {{0.0, end}, {value, value}, Beyond::constant};
  }

  /// Value, slope and integral in one; x may be anywhere. Meant for the innermost loops.
  CurvePoint evaluate(double x) const {
    const Piece& piece = pieces_[piece_at(x)];
    const double t = x - piece.start;
    const double* const c = piece.coefficient;
    return {c[0] + t * (c[1] + t * (c[2] + t * c[3])), c[1] + t * (2.0 * c[2] + t * (3.0 * c[3])),
            piece.integral +
                t * (c[0] + t * (c[1] / 2.0 + t * (c[2] * (1.0 / 3.0) + t * (c[3] / 4.0))))};
  }
  double value(double x) const { return evaluate(x).value; }

  /// The points it goes through.
  const std::vector<double>& x() const { return x_; }
  const std::vector<double>& values() const { return values_; }
  Beyond beyond() const { return beyond_; }
  double first() const { return x_.front(); }
  double last() const { return x_.back(); }
  /// Of all points.
  double largest_value() const { return *std::max_element(values_.begin(), values_.end()); }

  bool operator==(const Curve& other) const {
    return x_ == other.x_ && values_ == other.values_ && beyond_ == other.beyond_;
  }

 private:
  /// A polynomial in x - start, and the curve's integral from 0 to start.
  struct Piece {
    double start = 0.0;
    double coefficient[4] = {0.0, 0.0, 0.0, 0.0};
    double integral = 0.0;
  };

  void make_pieces();
  void integrate_pieces();
  void fill_table();
  /// Piece 0 lies before the first point; behind the last piece is one that begins nowhere (NaN).
  std::size_t piece_at(double x) const {
    // Not a number gives the first cell, by the order of max's arguments.
    const double cell = std::max(0.0, (x - first_) * cells_per_x_ + 1.0);
    std::size_t piece = table_[static_cast<std::size_t>(std::min(cell, last_cell_))];
    // The table gives the piece in which the cell begins; seldom does more than one begin inside
    // it.
    piece += x >= pieces_[piece + 1].start ? 1 : 0;
    while (x >= pieces_[piece + 1].start) ++piece;
    return piece;
  }

  std::vector<double> x_, values_;
  Beyond beyond_ = Beyond::linear;
  std::vector<Piece> pieces_;
  std::vector<std::uint32_t> table_;
  double first_ = 0.0, cells_per_x_ = 0.0, last_cell_ = 0.0;
};

/// Places of both curves in increasing order, each once; those that differ by rounding count as
/// one.
std::vector<double> common_places(const Curve& a, const Curve& b);
/// Through the means of both at those places; goes on as `a` does.
Curve mean_curve(const Curve& a, const Curve& b);

}  // namespace semblance
