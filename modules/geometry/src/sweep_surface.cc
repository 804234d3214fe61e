#include "semblance/geometry/sweep_surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Index;
using Eigen::Matrix2d;
using Eigen::Matrix3Xd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double two_pi = 2.0 * std::numbers::pi;

// Where a contour's controls begin in the flat vector, and how they follow each other.
struct ContourControls {
  Index position, slope, slope_after, bias, points;  // slope_after == slope, bias < 0 where absent
};

struct Layout {
  std::vector<ContourControls> contours;
  std::vector<Index> segments;  // n; heights of x and y follow
  Index count = 0;
};

Layout layout_of(const std::vector<SweepContour>& contours,
                 const std::vector<SweepSegment>& segments) {
  Layout layout;
  Index at = 0;
  for (const SweepContour& c : contours) {
    ContourControls place{at, at + 1, at + 1, -1, 0};
    at += 3;
    if (c.slope_after) {
      place.slope_after = at;
      at += 2;
    }
    if (c.bias) place.bias = at++;
    place.points = at;
    at += 2 * c.contour.points().cols();
    layout.contours.push_back(place);
  }
  for (const SweepSegment& s : segments) {
    layout.segments.push_back(at);
    at += 1 + static_cast<Index>(s.features_x.size() + s.features_y.size());
  }
  layout.count = at;
  return layout;
}

const Vector2d& slope_after(const SweepContour& c) {
  return c.slope_after ? *c.slope_after : c.slope;
}

std::string name_of(const char* what, std::size_t index) {
  return std::string("sweep: ") + what + " " + std::to_string(index + 1);
}

}  // namespace

// ds/dv at a segment's ends, and what they depend on besides the segment's own ends.
struct SweepSurface::Pace {
  double start, end;            // ds/dv at v = 0 and 1
  double before, own, after;    // intervals of s
  double start_bias, end_bias;  // 0 where there is none
};

// Everything at one v that does not depend on u.
struct SweepSurface::Section {
  Pace pace;
  HomotopyWeights path;
  double s, ds_dv;
  Blend blend;
  ScalingFunction scaling[2];
  ValueSlope scale[2];
  Vector3d point, velocity;  // T and dT/ds
  FramePoint frame;

  // c and dc/dv from the two contours' coordinates; linear, so it serves tangents in u as well.
  Vector2d blended(const Vector2d& c1, const Vector2d& c2) const {
    return (1.0 - blend.value) * c1 + blend.value * c2;
  }
  Vector2d grown(const Vector2d& c) const {
    return {c.x() * (1.0 + scale[0].value), c.y() * (1.0 + scale[1].value)};
  }
  Vector3d in_space(const Vector2d& c) const {
    return c.x() * frame.normal + c.y() * frame.binormal;
  }
  // dP/ds with the section's coordinates held.
  Vector3d along(const Vector2d& c) const {
    return velocity + c.x() * frame.normal_ds + c.y() * frame.binormal_ds;
  }
};

SweepSurface::SweepSurface(MovingFrame frame, std::vector<SweepContour> contours,
                           std::vector<SweepSegment> segments)
    : frame_(std::move(frame)), contours_(std::move(contours)), segments_(std::move(segments)) {
  check();
}

void SweepSurface::check() const {
  if (contours_.size() < 2) throw InvalidInput("sweep: at least two contours are needed");
  if (segments_.size() + 1 != contours_.size()) {
    throw InvalidInput("sweep: " + std::to_string(contours_.size()) + " contours need " +
                       std::to_string(contours_.size() - 1) + " segments between them, not " +
                       std::to_string(segments_.size()));
  }
  for (std::size_t i = 0; i < contours_.size(); ++i) {
    const SweepContour& c = contours_[i];
    const double least = i > 0 ? contours_[i - 1].position : 0.0;
    if (!(c.position >= least && c.position <= 1.0) || (i > 0 && c.position == least)) {
      throw InvalidInput(name_of("contour", i) + " lies at " + std::to_string(c.position) +
                         "; positions must increase from contour to contour inside [0, 1]");
    }
    if (!c.slope.allFinite() || !slope_after(c).allFinite()) {
      throw InvalidInput(name_of("contour", i) + ": slopes must be finite");
    }
    if (c.contour.points().cols() != contours_[0].contour.points().cols()) {
      throw InvalidInput(name_of("contour", i) +
                         ": all contours need as many points; bring them into correspondence");
    }
    const bool inner = i > 0 && i + 1 < contours_.size();
    if (c.slope_after && !inner) {
      throw InvalidInput(name_of("contour", i) + ": a crease (slope_after) needs an inner contour");
    }
    if (c.bias && !(inner && *c.bias > 0.0 && std::isfinite(*c.bias))) {
      throw InvalidInput(name_of("contour", i) + ": a bias k > 0 belongs to an inner contour");
    }
  }
  for (std::size_t i = 0; i < segments_.size(); ++i) {
    try {
      for (double v : {0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0}) {
        if (!(section(static_cast<int>(i), v).ds_dv > 0.0)) {
          throw InvalidInput("the bias makes the trajectory run backwards; bring k nearer to 1");
        }
      }
    } catch (const InvalidInput& error) {
      throw InvalidInput(name_of("segment", i) + ": " + error.what());
    }
  }
}

SweepSurface::Pace SweepSurface::pace(int segment) const {
  const auto interval = [&](int i) {
    return i < 0 || i >= segment_count() ? 0.0 : contours_[i + 1].position - contours_[i].position;
  };
  Pace p{};
  p.before = interval(segment - 1);
  p.own = interval(segment);
  p.after = interval(segment + 1);
  p.start_bias = contours_[segment].bias.value_or(0.0);
  p.end_bias = contours_[segment + 1].bias.value_or(0.0);
  // The geometric mean of the two speeds at a biased joint stays that of the linear trajectory.
  p.start = p.start_bias > 0.0 ? std::sqrt(p.before * p.own / p.start_bias) : p.own;
  p.end = p.end_bias > 0.0 ? std::sqrt(p.own * p.after * p.end_bias) : p.own;
  return p;
}

SweepSurface::Section SweepSurface::section(int segment, double v) const {
  const SweepContour &first = contours_[segment], &second = contours_[segment + 1];
  const SweepSegment& form = segments_[segment];
  Section q;
  q.pace = pace(segment);
  // s keeps n = 0: with it an unbiased segment has s linear in v.
  q.path = homotopy_weights(v, 0.0);
  q.s = first.position + q.pace.own * q.path.change.value + q.pace.start * q.path.start.value +
        q.pace.end * q.path.end.value;
  q.ds_dv = q.pace.own * q.path.change.slope + q.pace.start * q.path.start.slope +
            q.pace.end * q.path.end.slope;
  q.blend = blend(form.blend, v, form.n);
  for (int k = 0; k < 2; ++k) {
    q.scaling[k] =
        ScalingFunction(slope_after(first)[k] * q.pace.start, second.slope[k] * q.pace.end,
                        k == 0 ? form.features_x : form.features_y);
    q.scale[k] = q.scaling[k].at(v);
  }
  const CurvePoint curve = frame_.curve().at(q.s);
  q.point = curve.point;
  q.velocity = curve.first;
  q.frame = frame_.at(q.s);
  return q;
}

SweepSurface::Sample SweepSurface::at(double u, double v) const {
  const double inside = std::clamp(v, 0.0, double(segment_count()));
  const int segment = std::min(static_cast<int>(inside), segment_count() - 1);
  return at(u, segment, inside - segment);
}

SweepSurface::Sample SweepSurface::at(double u, int segment, double v) const {
  const Section q = section(segment, v);
  const auto c1 = contours_[segment].contour.at(u), c2 = contours_[segment + 1].contour.at(u);
  const Vector2d mean = q.blended(c1.point, c2.point), c = q.grown(mean);
  const Vector2d growth = q.blend.slope * (c2.point - c1.point);
  const Vector2d dc =
      q.grown(growth) + Vector2d(mean.x() * q.scale[0].slope, mean.y() * q.scale[1].slope);
  return {q.point + q.in_space(c), q.in_space(q.grown(q.blended(c1.tangent, c2.tangent))),
          q.along(c) * q.ds_dv + q.in_space(dc)};
}

VectorXd SweepSurface::controls() const {
  const Layout layout = layout_of(contours_, segments_);
  VectorXd x(layout.count);
  for (std::size_t i = 0; i < contours_.size(); ++i) {
    const SweepContour& c = contours_[i];
    const ContourControls& at = layout.contours[i];
    x[at.position] = c.position;
    x.segment<2>(at.slope) = c.slope;
    if (c.slope_after) x.segment<2>(at.slope_after) = *c.slope_after;
    if (c.bias) x[at.bias] = *c.bias;
    x.segment(at.points, 2 * c.contour.points().cols()) = c.contour.points().reshaped();
  }
  for (std::size_t i = 0; i < segments_.size(); ++i) {
    Index at = layout.segments[i];
    x[at++] = segments_[i].n;
    for (const Vector2d& f : segments_[i].features_x) x[at++] = f.y();
    for (const Vector2d& f : segments_[i].features_y) x[at++] = f.y();
  }
  return x;
}

std::vector<std::string> SweepSurface::control_names() const {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < contours_.size(); ++i) {
    const std::string prefix = "contour" + std::to_string(i) + ".";
    for (const char* name : {"position", "slope_x", "slope_y"}) names.push_back(prefix + name);
    if (contours_[i].slope_after) {
      for (const char* name : {"slope_after_x", "slope_after_y"}) names.push_back(prefix + name);
    }
    if (contours_[i].bias) names.push_back(prefix + "bias");
    for (Index k = 0; k < contours_[i].contour.points().cols(); ++k) {
      names.push_back(prefix + "x" + std::to_string(k));
      names.push_back(prefix + "y" + std::to_string(k));
    }
  }
  for (std::size_t i = 0; i < segments_.size(); ++i) {
    const std::string prefix = "segment" + std::to_string(i) + ".";
    names.push_back(prefix + "n");
    for (const auto& [axis, list] :
         {std::pair{"x", &segments_[i].features_x}, std::pair{"y", &segments_[i].features_y}}) {
      for (std::size_t k = 0; k < list->size(); ++k) {
        names.push_back(prefix + "height_" + axis + std::to_string(k));
      }
    }
  }
  return names;
}

void SweepSurface::set_controls(const VectorXd& x) {
  const Layout layout = layout_of(contours_, segments_);
  if (x.size() != layout.count || !x.allFinite()) {
    throw InvalidInput("sweep: " + std::to_string(layout.count) + " finite controls were expected");
  }
  SweepSurface changed = *this;
  for (std::size_t i = 0; i < contours_.size(); ++i) {
    SweepContour& c = changed.contours_[i];
    const ContourControls& at = layout.contours[i];
    c.position = x[at.position];
    c.slope = x.segment<2>(at.slope);
    if (c.slope_after) c.slope_after = x.segment<2>(at.slope_after);
    if (c.bias) c.bias = x[at.bias];
    const Index points = c.contour.points().cols();
    c.contour =
        PlanarContour(x.segment(at.points, 2 * points).reshaped(2, points), c.contour.kind());
  }
  for (std::size_t i = 0; i < segments_.size(); ++i) {
    Index at = layout.segments[i];
    changed.segments_[i].n = x[at++];
    for (Vector2d& f : changed.segments_[i].features_x) f.y() = x[at++];
    for (Vector2d& f : changed.segments_[i].features_y) f.y() = x[at++];
  }
  changed.check();
  *this = std::move(changed);
}

Matrix3Xd SweepSurface::derivatives(double u, int segment, double v) const {
  const Layout layout = layout_of(contours_, segments_);
  Matrix3Xd d = Matrix3Xd::Zero(3, layout.count);
  const Section q = section(segment, v);
  const SweepContour &first = contours_[segment], &second = contours_[segment + 1];
  const auto w1 = first.contour.weights(u).value, w2 = second.contour.weights(u).value;
  const Vector2d c1 = first.contour.points() * w1, c2 = second.contour.points() * w2;
  const Vector2d mean = q.blended(c1, c2);
  const Vector3d axis[2] = {q.frame.normal, q.frame.binormal};

  // Points and n.
  for (int k = 0; k < 2; ++k) {
    const Vector3d unit = axis[k] * (1.0 + q.scale[k].value);
    for (Index j = 0; j < w1.size(); ++j) {
      d.col(layout.contours[segment].points + 2 * j + k) = unit * ((1.0 - q.blend.value) * w1[j]);
      d.col(layout.contours[segment + 1].points + 2 * j + k) = unit * (q.blend.value * w2[j]);
    }
  }
  d.col(layout.segments[segment]) = q.in_space(q.grown(q.blend.value_dn * (c2 - c1)));

  // Slopes and heights, and how P changes with the paces through the slopes in v.
  Vector3d by_start = q.along(q.grown(mean)) * q.path.start.value;
  Vector3d by_end = q.along(q.grown(mean)) * q.path.end.value;
  Index height = layout.segments[segment] + 1;
  for (int k = 0; k < 2; ++k) {
    const VectorXd s = q.scaling[k].derivatives(v).value;
    const Vector3d unit = axis[k] * mean[k];
    d.col(layout.contours[segment].slope_after + k) = unit * (s[0] * q.pace.start);
    d.col(layout.contours[segment + 1].slope + k) = unit * (s[1] * q.pace.end);
    by_start += unit * (s[0] * slope_after(first)[k]);
    by_end += unit * (s[1] * second.slope[k]);
    for (Index j = 2; j < s.size(); ++j) d.col(height++) = unit * s[j];
  }

  // Positions and biases, through s and the paces at both ends.
  const Pace& p = q.pace;
  const auto position = [&](int contour) -> auto{
    return d.col(layout.contours[contour].position);
  };
  const Vector3d along = q.along(q.grown(mean));
  position(segment) += along * (1.0 - q.path.change.value);
  position(segment + 1) += along * q.path.change.value;
  const auto add_interval = [&](int interval, const Vector3d& by) {
    position(interval + 1) += by;
    position(interval) -= by;
  };
  if (p.start_bias > 0.0) {
    add_interval(segment - 1, by_start * (0.5 * p.start / p.before));
    add_interval(segment, by_start * (0.5 * p.start / p.own));
    d.col(layout.contours[segment].bias) = by_start * (-0.5 * p.start / p.start_bias);
  } else {
    add_interval(segment, by_start);
  }
  if (p.end_bias > 0.0) {
    add_interval(segment + 1, by_end * (0.5 * p.end / p.after));
    add_interval(segment, by_end * (0.5 * p.end / p.own));
    d.col(layout.contours[segment + 1].bias) = by_end * (0.5 * p.end / p.end_bias);
  } else {
    add_interval(segment, by_end);
  }
  return d;
}

Mesh SweepSurface::mesh(int around, int along, bool caps) const {
  if (around < 3 || along < 1 || around > 16384 || along > 16384) {
    throw InvalidInput("sweep: a mesh needs 3 to 16384 steps around and 1 to 16384 along");
  }
  const Index rows = Index(segment_count()) * along + 1;
  if (rows * around > 20'000'000) {
    throw InvalidInput("sweep: a mesh of more than 20 million vertices; take fewer steps");
  }
  Mesh mesh;
  mesh.positions_m.resize(rows * around + (caps ? 2 : 0), 3);
  for (Index row = 0; row < rows; ++row) {
    const int segment = std::min(static_cast<int>(row / along), segment_count() - 1);
    const double v = double(row - Index(segment) * along) / along;
    const Section q = section(segment, v);
    for (int k = 0; k < around; ++k) {
      const double u = two_pi * k / around;
      const Vector2d c = q.grown(q.blended(contours_[segment].contour.at(u).point,
                                           contours_[segment + 1].contour.at(u).point));
      mesh.positions_m.row(row * around + k) = q.point + q.in_space(c);
    }
  }
  std::vector<Eigen::Vector3i> triangles;
  for (int row = 0; row + 1 < rows; ++row) {
    for (int k = 0; k < around; ++k) {
      const int a = row * around + k, b = row * around + (k + 1) % around;
      triangles.emplace_back(a, b, b + around);
      triangles.emplace_back(a, b + around, a + around);
    }
  }
  if (caps) {
    const int last = static_cast<int>(rows - 1) * around, middle = static_cast<int>(rows) * around;
    mesh.positions_m.row(middle) = mesh.positions_m.topRows(around).colwise().mean();
    mesh.positions_m.row(middle + 1) = mesh.positions_m.middleRows(last, around).colwise().mean();
    for (int k = 0; k < around; ++k) {
      const int next = (k + 1) % around;
      triangles.emplace_back(middle, next, k);
      triangles.emplace_back(middle + 1, last + k, last + next);
    }
  }
  mesh.triangles.resize(static_cast<Index>(triangles.size()), 3);
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    mesh.triangles.row(static_cast<Index>(i)) = triangles[i];
  }
  return mesh;
}

}  // namespace semblance
