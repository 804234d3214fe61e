#include "semblance/geometry/contour_slopes.h"

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Index;
using Row = Eigen::Array<double, 1, Eigen::Dynamic>;
using Rows = Eigen::Array<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Lengths of the segments and slopes of their chords.
struct Chords {
  Eigen::ArrayXd length;
  Rows slope;
};

Chords chords_of(const std::vector<double>& heights, const Rows& values) {
  const Index segments = values.rows() - 1;
  Chords chords{Eigen::ArrayXd(segments), Rows(segments, values.cols())};
  for (Index i = 0; i < segments; ++i) {
    chords.length[i] = heights[i + 1] - heights[i];
    if (!(chords.length[i] > 0.0)) throw InvalidInput("contours: heights must increase");
    chords.slope.row(i) = (values.row(i + 1) - values.row(i)) / chords.length[i];
  }
  return chords;
}

/// The tridiagonal equations of the slopes (de Boor, A Practical Guide to Splines, chapter IV).
Rows natural(const Chords& chords) {
  const Index last = chords.slope.rows();
  Eigen::ArrayXd diagonal(last + 1), above(last + 1);
  Rows slopes(last + 1, chords.slope.cols());
  diagonal[0] = 2.0;
  above[0] = 1.0;
  slopes.row(0) = 3.0 * chords.slope.row(0);
  for (Index i = 1; i <= last; ++i) {
    const bool end = i == last;
    const double below = end ? 1.0 : chords.length[i], before = chords.length[i - 1];
    const double centre = end ? 2.0 : 2.0 * (below + before);
    const double factor = below / diagonal[i - 1];
    diagonal[i] = centre - factor * above[i - 1];
    above[i] = end ? 0.0 : before;
    slopes.row(i) =
        end ? Row(3.0 * chords.slope.row(i - 1))
            : Row(3.0 * (below * chords.slope.row(i - 1) + before * chords.slope.row(i)));
    slopes.row(i) -= factor * slopes.row(i - 1);
  }
  slopes.row(last) /= diagonal[last];
  for (Index i = last - 1; i >= 0; --i) {
    slopes.row(i) = (slopes.row(i) - above[i] * slopes.row(i + 1)) / diagonal[i];
  }
  return slopes;
}

Rows catmull_rom(const Chords& chords) {
  const Index last = chords.slope.rows();
  Rows slopes(last + 1, chords.slope.cols());
  slopes.row(0) = chords.slope.row(0);
  slopes.row(last) = chords.slope.row(last - 1);
  for (Index i = 1; i < last; ++i) {
    const double a = chords.length[i - 1], b = chords.length[i];
    slopes.row(i) = (a * chords.slope.row(i - 1) + b * chords.slope.row(i)) / (a + b);
  }
  return slopes;
}

/// Slope at an end by the parabola through three values, kept within what is monotone.
double monotone_end(double near_length, double far_length, double near, double far) {
  const double slope =
      ((2.0 * near_length + far_length) * near - near_length * far) / (near_length + far_length);
  if (slope * near <= 0.0) return 0.0;
  if (near * far <= 0.0 && std::abs(slope) > 3.0 * std::abs(near)) return 3.0 * near;
  return slope;
}

Rows monotone(const Chords& chords) {
  const Index last = chords.slope.rows();
  Rows slopes(last + 1, chords.slope.cols());
  if (last == 1) return chords.slope.row(0).replicate(2, 1);
  const auto& h = chords.length;
  for (Index j = 0; j < slopes.cols(); ++j) {
    const auto chord = chords.slope.col(j);
    slopes(0, j) = monotone_end(h[0], h[1], chord[0], chord[1]);
    slopes(last, j) = monotone_end(h[last - 1], h[last - 2], chord[last - 1], chord[last - 2]);
    for (Index i = 1; i < last; ++i) {
      const double a = 2.0 * h[i] + h[i - 1], b = h[i] + 2.0 * h[i - 1];
      slopes(i, j) =
          chord[i - 1] * chord[i] <= 0.0 ? 0.0 : (a + b) / (a / chord[i - 1] + b / chord[i]);
    }
  }
  return slopes;
}

Rows akima(const Chords& chords) {
  const Index segments = chords.slope.rows(), columns = chords.slope.cols();
  // Two more chords at each end, on the parabola of the outermost two.
  Rows chord(segments + 4, columns);
  chord.middleRows(2, segments) = chords.slope;
  const Index next = segments > 1 ? 3 : 2;
  chord.row(1) = 2.0 * chord.row(2) - chord.row(next);
  chord.row(0) = 2.0 * chord.row(1) - chord.row(2);
  const Index end = segments + 1;
  chord.row(end + 1) = 2.0 * chord.row(end) - chord.row(segments > 1 ? end - 1 : end);
  chord.row(end + 2) = 2.0 * chord.row(end + 1) - chord.row(end);
  const auto weight = [&](Index i) {
    return Row((chord.row(i + 1) - chord.row(i)).abs() +
               0.5 * (chord.row(i + 1) + chord.row(i)).abs());
  };
  Rows slopes(segments + 1, columns);
  for (Index i = 0; i <= segments; ++i) {
    const Row below = weight(i), above = weight(i + 2), sum = below + above;
    slopes.row(i) = (sum > 0.0).select(
        (above * chord.row(i + 1) + below * chord.row(i + 2)) / sum.max(1e-300), 0.0);
  }
  return slopes;
}

Rows slopes_by(SlopeRule rule, const Chords& chords) {
  switch (rule) {
    case SlopeRule::natural:
      return natural(chords);
    case SlopeRule::catmull_rom:
      return catmull_rom(chords);
    case SlopeRule::monotone:
      return monotone(chords);
    case SlopeRule::akima:
      return akima(chords);
    case SlopeRule::null:
      break;
  }
  return Rows::Zero(chords.slope.rows() + 1, chords.slope.cols());
}

}  // namespace

std::string slope_rule_name(SlopeRule rule) {
  switch (rule) {
    case SlopeRule::natural:
      return "natural cubic spline";
    case SlopeRule::catmull_rom:
      return "Catmull-Rom";
    case SlopeRule::monotone:
      return "monotone cubic";
    case SlopeRule::akima:
      return "Akima";
    case SlopeRule::null:
      break;
  }
  return "null";
}

Grid contour_slopes(const std::vector<double>& heights_m, const Grid& values_m, SlopeRule rule) {
  if (values_m.rows() < 2 || static_cast<Index>(heights_m.size()) != values_m.rows()) {
    throw InvalidInput("contours: at least two are needed, and as many heights as contours");
  }
  return slopes_by(rule, chords_of(heights_m, values_m.cast<double>())).cast<float>();
}

Eigen::ArrayXd curve_slopes(const std::vector<double>& x, const std::vector<double>& values,
                            SlopeRule rule) {
  if (x.size() < 2 || x.size() != values.size()) {
    throw InvalidInput("a curve needs two points at least, and as many values as places");
  }
  const Eigen::Map<const Eigen::ArrayXd> column(values.data(), static_cast<Index>(values.size()));
  return slopes_by(rule, chords_of(x, column)).col(0);
}

}  // namespace semblance
