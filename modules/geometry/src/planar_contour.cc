#include "semblance/geometry/planar_contour.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Index;
using Eigen::Matrix2Xd;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr double two_pi = 2.0 * std::numbers::pi;
constexpr Index most_points = 65536;

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// Twice the area, positive counter-clockwise.
double signed_area(const Matrix2Xd& p) {
  double sum = 0.0;
  for (Index i = 0; i < p.cols(); ++i) sum += cross(p.col(i), p.col((i + 1) % p.cols()));
  return sum;
}

// Fraction of a step and the point before it.
struct Place {
  Index before, after;
  double fraction;
};
Place place_of(double u, Index count) {
  double turns = u / two_pi;
  turns -= std::floor(turns);
  const double x = turns * double(count);
  const Index i = std::min<Index>(static_cast<Index>(x), count - 1);
  return {i, (i + 1) % count, x - double(i)};
}

bool segments_touch(const Vector2d& a, const Vector2d& b, const Vector2d& c, const Vector2d& d) {
  const auto side = [](const Vector2d& p, const Vector2d& q, const Vector2d& r) {
    const double s = cross(q - p, r - p);
    return (s > 0.0) - (s < 0.0);
  };
  const auto within = [](const Vector2d& p, const Vector2d& q, const Vector2d& r) {
    return (r.array() >= p.cwiseMin(q).array()).all() && (r.array() <= p.cwiseMax(q).array()).all();
  };
  const int s1 = side(a, b, c), s2 = side(a, b, d), s3 = side(c, d, a), s4 = side(c, d, b);
  if (s1 * s2 < 0 && s3 * s4 < 0) return true;
  return (s1 == 0 && within(a, b, c)) || (s2 == 0 && within(a, b, d)) ||
         (s3 == 0 && within(c, d, a)) || (s4 == 0 && within(c, d, b));
}

Matrix2Xd without_repeats(const Matrix2Xd& p) {
  Matrix2Xd kept(2, p.cols());
  Index count = 0;
  for (Index i = 0; i < p.cols(); ++i) {
    if (count == 0 || p.col(i) != kept.col(count - 1)) kept.col(count++) = p.col(i);
  }
  while (count > 1 && kept.col(count - 1) == kept.col(0)) --count;
  return kept.leftCols(count);
}

// Where segment (c, d) would let the outline cross itself: sorted by x, so that only segments whose
// extents overlap are compared.
void require_no_crossing(const Matrix2Xd& p, const std::string& source) {
  struct Extent {
    double low, high;
    Index index;
  };
  const Index n = p.cols();
  std::vector<Extent> extents;
  for (Index i = 0; i < n; ++i) {
    const double x0 = p(0, i), x1 = p(0, (i + 1) % n);
    extents.push_back({std::min(x0, x1), std::max(x0, x1), i});
  }
  std::sort(extents.begin(), extents.end(),
            [](const Extent& a, const Extent& b) { return a.low < b.low; });
  for (std::size_t a = 0; a < extents.size(); ++a) {
    for (std::size_t b = a + 1; b < extents.size() && extents[b].low <= extents[a].high; ++b) {
      const Index i = std::min(extents[a].index, extents[b].index);
      const Index j = std::max(extents[a].index, extents[b].index);
      if (j == i + 1 || (i == 0 && j == n - 1)) continue;  // neighbours share a point
      if (segments_touch(p.col(i), p.col(i + 1), p.col(j), p.col((j + 1) % n))) {
        throw InvalidInput(source + ": the contour crosses itself: its sides after points " +
                           std::to_string(i + 1) + " and " + std::to_string(j + 1) +
                           " meet; put the points in order along it, or remove the loop");
      }
    }
  }
}

Matrix2Xd counter_clockwise(const Matrix2Xd& outline) {
  Matrix2Xd p = without_repeats(outline);
  if (signed_area(p) < 0.0) p = p.rowwise().reverse().eval();
  return p;
}

// Points of a closed polygon at given fractions of its length.
class LengthParameter {
 public:
  explicit LengthParameter(const Matrix2Xd& outline) : points_(outline) {
    const Index n = outline.cols();
    length_ = VectorXd::Zero(n + 1);
    for (Index i = 0; i < n; ++i) {
      length_[i + 1] = length_[i] + (outline.col((i + 1) % n) - outline.col(i)).norm();
    }
  }
  Vector2d at(double fraction) const {
    const double target = (fraction - std::floor(fraction)) * length_[points_.cols()];
    const double* begin = length_.data();
    const Index n = points_.cols();
    const Index found = std::upper_bound(begin, begin + n + 1, target) - begin - 1;
    const Index i = std::clamp<Index>(found, 0, n - 1);
    const double t = (target - length_[i]) / (length_[i + 1] - length_[i]);
    return (1.0 - t) * points_.col(i) + t * points_.col((i + 1) % n);
  }
  double fraction_of_point(Index i) const { return length_[i] / length_[points_.cols()]; }
  Matrix2Xd equally(Index count, double start) const {
    Matrix2Xd p(2, count);
    for (Index k = 0; k < count; ++k) p.col(k) = at(start + double(k) / double(count));
    return p;
  }

 private:
  Matrix2Xd points_;
  VectorXd length_;
};

Matrix2Xd centred(const Matrix2Xd& p) { return p.colwise() - p.rowwise().mean(); }

// Radius along `angle` from the origin; the outline must wind once about it.
Matrix2Xd by_polar_angle(const Matrix2Xd& outline, Index count, const std::string& source) {
  const Index n = outline.cols();
  const std::string remedy =
      "; choose another correspondence (arc_length or matched), or move the contour so that every "
      "ray from its trajectory meets it once";
  double turned = 0.0;
  for (Index i = 0; i < n; ++i) {
    const Vector2d a = outline.col(i), b = outline.col((i + 1) % n);
    const double step = std::atan2(cross(a, b), a.dot(b));
    if (!(step > 0.0 && step < std::numbers::pi)) {
      throw InvalidInput(source + ": not star-shaped about the trajectory" + remedy);
    }
    turned += step;
  }
  if (std::abs(turned - two_pi) > 1e-6) {
    throw InvalidInput(source + ": does not go round the trajectory once" + remedy);
  }
  Matrix2Xd result(2, count);
  for (Index k = 0; k < count; ++k) {
    const double u = two_pi * double(k) / double(count);
    const Vector2d ray(std::cos(u), std::sin(u));
    for (Index i = 0; i < n; ++i) {
      const Vector2d a = outline.col(i), b = outline.col((i + 1) % n);
      // The ray lies in the wedge from a to b (closed at a).
      if (cross(a, ray) < 0.0 || cross(ray, b) <= 0.0 || a.dot(ray) + b.dot(ray) <= 0.0) continue;
      result.col(k) = ray * (cross(a, b - a) / cross(ray, b - a));
      break;
    }
  }
  return result;
}

// The start, in steps, at which `p` (both centred, equal counts) lies nearest to `target`.
Index best_shift(const Matrix2Xd& target, const Matrix2Xd& p) {
  const Index n = p.cols();
  Index best = 0;
  double least = INFINITY;
  for (Index shift = 0; shift < n; ++shift) {
    double sum = 0.0;
    for (Index k = 0; k < n; ++k) sum += (target.col(k) - p.col((k + shift) % n)).squaredNorm();
    if (sum < least) {
      least = sum;
      best = shift;
    }
  }
  return best;
}

// The fraction of length at which a ray along +x from the centroid leaves the outline.
double start_on_x_axis(const LengthParameter& outline, Index count) {
  const Matrix2Xd p = centred(outline.equally(count, 0.0));
  Index best = 0;
  double largest = -INFINITY;
  for (Index k = 0; k < count; ++k) {
    const double along = p(0, k) - 10.0 * std::abs(p(1, k));
    if (along > largest) {
      largest = along;
      best = k;
    }
  }
  return double(best) / double(count);
}

Matrix2Xd unit_tangents(const Matrix2Xd& p) {
  Matrix2Xd t(2, p.cols());
  for (Index k = 0; k < p.cols(); ++k) {
    t.col(k) = (p.col((k + 1) % p.cols()) - p.col((k + p.cols() - 1) % p.cols())).normalized();
  }
  return t;
}

// Steps of the matching along the two outlines: no part is passed more than three times as fast as
// the other (a slope constraint as in Sakoe and Chiba 1978).
constexpr int step_count = 5;
constexpr int step_a[step_count] = {1, 1, 2, 1, 3}, step_b[step_count] = {1, 2, 1, 3, 1};

struct Matching {
  double cost = INFINITY;
  VectorXd position;  // on b, in points, for each point of a
};

// Monotone assignment of positions on `b` to the points of `a`, equal counts, the first points
// together: least sum of `distance` (a's points down, b's across) over the steps.
Matching match_from_start(const Eigen::MatrixXd& distance) {
  const Index n = distance.rows();
  Eigen::MatrixXd cost = Eigen::MatrixXd::Constant(n + 1, n + 1, INFINITY);
  Eigen::MatrixXi from = Eigen::MatrixXi::Zero(n + 1, n + 1);
  cost(0, 0) = 0.0;
  for (Index i = 1; i <= n; ++i) {
    for (Index j = 1; j <= n; ++j) {
      for (int s = 0; s < step_count; ++s) {
        const Index i0 = i - step_a[s], j0 = j - step_b[s];
        if (i0 < 0 || j0 < 0) continue;
        const int parts = std::max(step_a[s], step_b[s]);
        double sum = 0.0;
        for (int m = 1; m <= parts; ++m) {
          sum += distance((i0 + (step_a[s] * m + parts - 1) / parts) % n,
                          (j0 + (step_b[s] * m + parts - 1) / parts) % n);
        }
        const double total = cost(i0, j0) + sum * (step_a[s] + step_b[s]) / (2.0 * parts);
        if (total < cost(i, j)) {
          cost(i, j) = total;
          from(i, j) = s;
        }
      }
    }
  }
  Matching matching{cost(n, n), VectorXd::Zero(n)};
  for (Index i = n, j = n; i > 0;) {
    const int s = from(i, j);
    for (int m = 1; m <= step_a[s]; ++m) {
      const Index k = i - step_a[s] + m;
      if (k < n) matching.position[k] = double(j) - step_b[s] * (1.0 - double(m) / step_a[s]);
    }
    i -= step_a[s];
    j -= step_b[s];
  }
  return matching;
}

// Fractions of b's length that belong to equal fractions of a's: like places and like directions.
VectorXd matched_fractions(const LengthParameter& a, double start_a, const LengthParameter& b,
                           double start_b) {
  constexpr Index n = 192;  // a matching takes n^2 steps, for each of n / 4 starts
  const Matrix2Xd pa = centred(a.equally(n, start_a)), pb = centred(b.equally(n, start_b));
  const Matrix2Xd ta = unit_tangents(pa), tb = unit_tangents(pb);
  const double scale = pa.colwise().squaredNorm().mean();
  Eigen::MatrixXd distance(n, n);
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) {
      distance(i, j) =
          (pa.col(i) - pb.col(j)).squaredNorm() / scale + (ta.col(i) - tb.col(j)).squaredNorm();
    }
  }
  Matching best;
  Index best_shift = 0;
  for (Index shift = -n / 8; shift <= n / 8; ++shift) {
    Eigen::MatrixXd turned(n, n);
    for (Index j = 0; j < n; ++j) turned.col(j) = distance.col((j + shift + n) % n);
    Matching matching = match_from_start(turned);
    if (matching.cost < best.cost) {
      best = std::move(matching);
      best_shift = shift;
    }
  }
  return (best.position.array() + double(best_shift)) / double(n) + start_b;
}

// Linear interpolation of positions at equal steps of a closed parameter, where a turn adds 1.
double at_fraction(const VectorXd& positions, double fraction) {
  const Index n = positions.size();
  const double x = fraction * double(n);
  const Index i = std::min<Index>(static_cast<Index>(x), n - 1);
  const double next = i + 1 < n ? positions[i + 1] : positions[0] + 1.0;
  return positions[i] + (x - double(i)) * (next - positions[i]);
}

}  // namespace

PlanarContour::PlanarContour(Matrix2Xd points_m, ContourKind kind)
    : points_(std::move(points_m)), kind_(kind) {
  if (points_.cols() < 3 || points_.cols() > most_points || !points_.allFinite()) {
    throw InvalidInput("contour: 3 to 65536 finite points were expected");
  }
  if (kind_ == ContourKind::polygon) return;
  x_ = PeriodicContour(points_.row(0).transpose());
  y_ = PeriodicContour(points_.row(1).transpose());
  cardinal_ = PeriodicContour(VectorXd::Unit(points_.cols(), 0));
}

PlanarContour::Sample PlanarContour::at(double u) const {
  if (kind_ == ContourKind::smooth) {
    const ValueSlope x = x_.at(u), y = y_.at(u);
    return {{x.value, y.value}, {x.slope, y.slope}};
  }
  const Place p = place_of(u, points_.cols());
  const Vector2d a = points_.col(p.before), b = points_.col(p.after);
  return {(1.0 - p.fraction) * a + p.fraction * b, (b - a) * (double(points_.cols()) / two_pi)};
}

PlanarContour::Weights PlanarContour::weights(double u) const {
  const Index n = points_.cols();
  Weights w{VectorXd::Zero(n), VectorXd::Zero(n)};
  if (kind_ == ContourKind::polygon) {
    const Place p = place_of(u, n);
    const double rate = double(n) / two_pi;
    w.value[p.before] = 1.0 - p.fraction;
    w.value[p.after] = p.fraction;
    w.slope[p.before] = -rate;
    w.slope[p.after] = rate;
    return w;
  }
  for (Index k = 0; k < n; ++k) {
    const ValueSlope c = cardinal_.at(u - two_pi * double(k) / double(n));
    w.value[k] = c.value;
    w.slope[k] = c.slope;
  }
  return w;
}

Matrix2Xd named_outline(const std::string& name, double size_m, int point_count) {
  if (!(size_m > 0.0) || !std::isfinite(size_m)) {
    throw InvalidInput("contour '" + name + "': the size must be positive");
  }
  const auto polar = [&](double u) -> Vector2d {
    const Vector2d ray(std::cos(u), std::sin(u));
    if (name == "circle") return ray;
    if (name == "square") return ray / ray.cwiseAbs().maxCoeff();
    if (name == "wave") return ray * (1.0 + 0.15 * std::cos(8.0 * u));
    if (name == "ellipse") return {ray.x(), 0.5 * ray.y()};
    throw InvalidInput("contour '" + name +
                       "': no such shape; there are circle, square, wave and ellipse");
  };
  Matrix2Xd points(2, point_count);
  for (int k = 0; k < point_count; ++k) points.col(k) = size_m * polar(two_pi * k / point_count);
  return points;
}

void require_simple(const Matrix2Xd& outline, const std::string& source) {
  if (outline.cols() == 0) throw InvalidInput(source + ": the contour is empty");
  if (!outline.allFinite()) {
    throw InvalidInput(source + ": the contour's coordinates must be finite numbers");
  }
  const Matrix2Xd p = without_repeats(outline);
  if (p.cols() < 3 || p.cols() > most_points) {
    throw InvalidInput(source + ": a contour needs 3 to 65536 different points in a row");
  }
  require_no_crossing(p, source);
  const double extent = (p.rowwise().maxCoeff() - p.rowwise().minCoeff()).norm();
  if (!(std::abs(signed_area(p)) > 1e-12 * extent * extent)) {
    throw InvalidInput(source + ": the contour encloses no area");
  }
}

std::vector<Matrix2Xd> correspond(const std::vector<Matrix2Xd>& outlines, Correspondence method,
                                  int point_count) {
  if (point_count < 3 || point_count > 4096) {
    throw InvalidInput("contours are brought into correspondence with 3 to 4096 points");
  }
  std::vector<Matrix2Xd> result;
  for (std::size_t i = 0; i < outlines.size(); ++i) {
    const std::string source = "contour " + std::to_string(i + 1);
    require_simple(outlines[i], source);
    const Matrix2Xd outline = counter_clockwise(outlines[i]);
    if (method == Correspondence::polar) {
      result.push_back(by_polar_angle(outline, point_count, source));
      continue;
    }
    const LengthParameter length(outline);
    if (i == 0) {
      result.push_back(length.equally(point_count, start_on_x_axis(length, 4 * point_count)));
      continue;
    }
    const Matrix2Xd& before = result.back();
    const Matrix2Xd p = length.equally(point_count, 0.0);
    const double start = double(best_shift(centred(before), centred(p))) / point_count;
    if (method == Correspondence::arc_length) {
      result.push_back(length.equally(point_count, start));
      continue;
    }
    // Points of `before` need not be equally far apart: match along its length, then go back to u.
    const LengthParameter length_before(before);
    const VectorXd matched = matched_fractions(length_before, 0.0, length, start);
    Matrix2Xd points(2, point_count);
    for (Index k = 0; k < point_count; ++k) {
      points.col(k) = length.at(at_fraction(matched, length_before.fraction_of_point(k)));
    }
    result.push_back(points);
  }
  return result;
}

}  // namespace semblance
