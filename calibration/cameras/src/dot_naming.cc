#include "dot_naming.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "semblance/cameras/adjustment.h"
#include "semblance/core/errors.h"
#include "three_point_pose.h"

namespace semblance {
namespace {

using Eigen::Matrix2Xd;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kFewestNamed = 7;       // by chance six dots fall on points too often
constexpr double kFewestShare = 0.6;  // of the dots within the points' outline
constexpr double kReachOfExtent = 0.02, kLeastReach_px = 3.0;
constexpr int kNeighbours = 10;
constexpr std::size_t kTriplesAtOnce = 10, kMostTriples = 60;
constexpr double kGoodShare = 0.7;  // of the dots found: no more triples are tried
constexpr std::size_t kMostHypotheses = 12;
constexpr double kNearlyAsMany = 0.8, kNearlyAsGood = 2.0, kAlwaysAsGood_px = 0.5;
constexpr double kInfinite = std::numeric_limits<double>::infinity();

std::vector<int> nearest_first(const std::vector<Vector3d>& points, int from) {
  std::vector<std::pair<double, int>> order;
  for (int i = 0; i < static_cast<int>(points.size()); ++i) {
    if (i != from) {
      order.emplace_back(
          (points[static_cast<std::size_t>(i)] - points[static_cast<std::size_t>(from)])
              .squaredNorm(),
          i);
    }
  }
  std::sort(order.begin(), order.end());
  std::vector<int> result;
  for (const auto& [distance, i] : order) result.push_back(i);
  return result;
}

std::vector<Vector3d> flat_points(const Matrix2Xd& dots) {
  std::vector<Vector3d> result;
  for (const auto& dot : dots.colwise()) result.emplace_back(dot.x(), dot.y(), 0.0);
  return result;
}

/// Dots in threes: each with two of its neighbours, first the nearer ones, wide triangles only.
std::vector<std::array<int, 3>> dot_triples(const Matrix2Xd& dots) {
  const std::vector<Vector3d> places = flat_points(dots);
  std::vector<std::array<int, 3>> result;
  // Neighbours in pairs by rank, so that every dot has its turn before wider triangles come.
  constexpr std::array<std::pair<int, int>, 6> ranks{
      {{0, 1}, {1, 2}, {0, 2}, {2, 3}, {1, 3}, {3, 5}}};
  for (const auto& [first, second] : ranks) {
    for (int i = 0; i < static_cast<int>(places.size()); ++i) {
      const std::vector<int> order = nearest_first(places, i);
      if (second >= static_cast<int>(order.size())) continue;
      const std::array<int, 3> triple{i, order[static_cast<std::size_t>(first)],
                                      order[static_cast<std::size_t>(second)]};
      const Vector2d a = dots.col(triple[1]) - dots.col(i), b = dots.col(triple[2]) - dots.col(i);
      const double area = std::abs(a.x() * b.y() - a.y() * b.x());
      if (area > 0.3 * a.norm() * b.norm()) result.push_back(triple);
    }
  }
  if (result.size() > kMostTriples) result.resize(kMostTriples);
  return result;
}

/// Which dot is near a place, by a table.
class DotTable {
 public:
  DotTable(const Matrix2Xd& dots, double reach) : cell_(reach / 2.0) {
    lower_ = dots.rowwise().minCoeff().array() - reach;
    const Vector2d size = (dots.rowwise().maxCoeff().array() + reach).matrix() - lower_;
    columns_ = 1 + static_cast<int>(size.x() / cell_);
    rows_ = 1 + static_cast<int>(size.y() / cell_);
    table_.assign(static_cast<std::size_t>(columns_) * rows_, -1);
    std::vector<double> distance(table_.size(), reach);
    for (int k = 0; k < dots.cols(); ++k) {
      const Vector2d at = (dots.col(k) - lower_) / cell_;
      for (int y = static_cast<int>(at.y()) - 3; y <= static_cast<int>(at.y()) + 3; ++y) {
        for (int x = static_cast<int>(at.x()) - 3; x <= static_cast<int>(at.x()) + 3; ++x) {
          if (x < 0 || y < 0 || x >= columns_ || y >= rows_) continue;
          const double d = cell_ * (Vector2d(x + 0.5, y + 0.5) - at).norm();
          const auto index = static_cast<std::size_t>(y) * columns_ + x;
          if (d >= distance[index]) continue;
          distance[index] = d;
          table_[index] = k;
        }
      }
    }
  }
  int at(const Vector2d& place) const {
    const Vector2d cell = (place - lower_) / cell_;
    if (!(cell.x() >= 0.0) || !(cell.y() >= 0.0) || cell.x() >= columns_ || cell.y() >= rows_) {
      return -1;
    }
    return table_[static_cast<std::size_t>(cell.y()) * columns_ +
                  static_cast<std::size_t>(cell.x())];
  }

 private:
  double cell_;
  Vector2d lower_;
  int columns_ = 0, rows_ = 0;
  std::vector<int> table_;
};

/// Share of the dots named by both that have different names; 1 where they have none in common.
double difference(const std::vector<int>& a, const std::vector<int>& b) {
  int both = 0, different = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i] < 0 || b[i] < 0) continue;
    ++both;
    different += a[i] != b[i];
  }
  return both == 0 ? 1.0 : static_cast<double>(different) / both;
}

double extent_of(const Matrix2Xd& dots) {
  return (dots.rowwise().maxCoeff() - dots.rowwise().minCoeff()).norm();
}

bool better(const Naming& a, const Naming& b) {
  return a.named != b.named ? a.named > b.named : a.rms_px < b.rms_px;
}

/// The best of several, and whether another is nearly as good.
std::optional<Naming> best_of(const std::vector<Naming>& namings) {
  if (namings.empty()) return std::nullopt;
  Naming best = *std::min_element(namings.begin(), namings.end(), better);
  constexpr double other_names = 0.5;
  for (const Naming& rival : namings) {
    best.ambiguous =
        best.ambiguous || (rival.named >= kNearlyAsMany * best.named &&
                           rival.rms_px < kNearlyAsGood * best.rms_px + kAlwaysAsGood_px &&
                           difference(rival.point_of_dot, best.point_of_dot) > other_names);
  }
  return best;
}

}  // namespace

struct DotNamer::Hypothesis {
  int hits = 0;
  Rigid3 pose;
  std::vector<int> point_of_dot;
};

DotNamer::DotNamer(std::vector<Vector3d> points_m, std::vector<std::optional<Vector3d>> normals)
    : points_m_(std::move(points_m)), normals_(std::move(normals)) {
  for (int i = 0; i < static_cast<int>(points_m_.size()); ++i) {
    neighbours_.push_back(nearest_first(points_m_, i));
    if (neighbours_.back().size() > kNeighbours) neighbours_.back().resize(kNeighbours);
  }
}

bool DotNamer::faces(int point, const Rigid3& camera_from_object) const {
  const auto& normal = normals_[static_cast<std::size_t>(point)];
  if (!normal) return true;
  const Vector3d seen = camera_from_object * points_m_[static_cast<std::size_t>(point)];
  return (camera_from_object.rotation * *normal).dot(seen) < 0.0;
}

std::vector<int> DotNamer::assign(const Camera& camera, const Rigid3& camera_from_object,
                                  const Matrix2Xd& dots_px, double reach_px) const {
  const auto dots = static_cast<std::size_t>(dots_px.cols());
  std::vector<Vector2d> places(points_m_.size());
  std::vector<double> depths(points_m_.size(), kInfinite);
  for (std::size_t i = 0; i < points_m_.size(); ++i) {
    const Vector3d seen = camera_from_object * points_m_[i];
    if (!(seen.z() > 0.0) || !faces(static_cast<int>(i), camera_from_object)) continue;
    places[i] = project(camera, seen);
    depths[i] = seen.z();
  }
  // The best pairs first.
  struct Pair {
    double distance_px;
    int dot, point;
  };
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < points_m_.size(); ++i) {
    if (depths[i] == kInfinite) continue;
    for (std::size_t j = 0; j < dots; ++j) {
      const double d = (places[i] - dots_px.col(static_cast<Eigen::Index>(j))).norm();
      if (d < reach_px) pairs.push_back({d, static_cast<int>(j), static_cast<int>(i)});
    }
  }
  std::sort(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) {
    return std::tie(a.distance_px, a.dot, a.point) < std::tie(b.distance_px, b.dot, b.point);
  });
  std::vector<int> point_of_dot(dots, -1);
  std::vector<char> taken(points_m_.size(), 0);
  for (const Pair& pair : pairs) {
    int& point = point_of_dot[static_cast<std::size_t>(pair.dot)];
    const auto candidate = static_cast<std::size_t>(pair.point);
    if (taken[candidate] != 0) continue;
    // Of two points behind one dot the far one is hidden by the object.
    const bool in_front = point >= 0 && depths[candidate] < depths[static_cast<std::size_t>(point)];
    if (point >= 0 && !in_front) continue;
    if (point >= 0) taken[static_cast<std::size_t>(point)] = 0;
    point = pair.point;
    taken[candidate] = 1;
  }
  return point_of_dot;
}

std::optional<Naming> DotNamer::refined(const Naming& start, const Matrix2Xd& dots_px,
                                        double reach_px, bool focal_known) const {
  Naming naming = start;
  constexpr int enough_for_focal = 10;
  for (const double share : {1.0, 0.7, 0.5, 0.5}) {
    naming.point_of_dot =
        assign(naming.camera, naming.camera_from_object, dots_px, share * reach_px);
    Survey survey;
    survey.cameras = {naming.camera};
    survey.cameras[0].camera_from_world = {};
    survey.world_from_target = {naming.camera_from_object};
    survey.points_m = points_m_;
    for (std::size_t j = 0; j < naming.point_of_dot.size(); ++j) {
      if (naming.point_of_dot[j] < 0) continue;
      survey.sightings.push_back(
          {0, 0, naming.point_of_dot[j], dots_px.col(static_cast<Eigen::Index>(j))});
    }
    naming.named = static_cast<int>(survey.sightings.size());
    if (naming.named < 4) return std::nullopt;
    AdjustmentOptions options;
    options.cameras = {CameraFreedom::none()};
    options.cameras[0].focal = !focal_known && naming.named >= enough_for_focal;
    options.outlier_sigmas.reset();
    options.covariance = false;
    options.max_iterations = 10;
    try {
      const Adjustment fit = adjust(survey, options);
      naming.camera = fit.survey.cameras[0];
      naming.camera_from_object = fit.survey.world_from_target[0];
      naming.rms_px = fit.rms_all_px;
    } catch (const SolverError&) {  // a wrong pose
      return std::nullopt;
    }
    const double change = naming.camera.focal_px.x() / start.camera.focal_px.x();
    if (!(change > 0.5 && change < 2.0) || !std::isfinite(naming.rms_px)) return std::nullopt;
  }
  // Points cover more dots than these by chance alone if the pose is wrong.
  Vector2d lower = Vector2d::Constant(kInfinite), upper = -lower;
  for (const Vector3d& point : points_m_) {
    const Vector2d at = project(naming.camera, naming.camera_from_object * point);
    lower = lower.cwiseMin(at);
    upper = upper.cwiseMax(at);
  }
  int covered = 0;
  for (const auto& dot : dots_px.colwise()) {
    covered += (dot.array() > lower.array()).all() && (dot.array() < upper.array()).all();
  }
  if (naming.named < kFewestNamed || naming.named < kFewestShare * covered) return std::nullopt;
  return naming;
}

std::optional<Naming> DotNamer::near(const Camera& camera, const Rigid3& camera_from_object,
                                     const Matrix2Xd& dots_px, double reach_px) const {
  if (dots_px.cols() < 4) return std::nullopt;
  Naming start;
  start.camera = camera;
  start.camera_from_object = camera_from_object;
  return refined(start, dots_px, reach_px, true);
}

/// Poses from triples of one picture's dots, the best of them with different names.
class DotNamer::Search {
 public:
  Search(const DotNamer& namer, const Camera& camera, const Matrix2Xd& dots_px)
      : namer_(namer), plain_(camera.without_distortion()) {
    Matrix2Xd straight(2, dots_px.cols());
    for (Eigen::Index k = 0; k < dots_px.cols(); ++k) {
      const Vector3d ray = unproject(camera, dots_px.col(k));
      if (!ray.allFinite()) return;
      straight.col(k) = project(plain_, ray);
      rays_.push_back(ray.normalized());
    }
    reach_px = std::max(kLeastReach_px, kReachOfExtent * extent_of(straight));
    triples_ = dot_triples(straight);
    table_.emplace(straight, reach_px);
    dot_hit_.resize(rays_.size());
  }

  /// Tries some more triples; false where there are none left.
  bool more() {
    if (next_ >= triples_.size()) return false;
    const std::size_t end = std::min(next_ + kTriplesAtOnce, triples_.size());
    for (; next_ < end; ++next_) try_triple(triples_[next_]);
    return true;
  }

  std::vector<Hypothesis> best;  // by hits
  double reach_px = 0.0;

 private:
  void try_triple(const std::array<int, 3>& triple) {
    const auto ray = [&](int k) { return rays_[static_cast<std::size_t>(triple[k])]; };
    const std::array<Vector3d, 3> rays{ray(0), ray(1), ray(2)};
    const auto point = [&](int k) { return namer_.points_m_[static_cast<std::size_t>(k)]; };
    for (int a = 0; a < static_cast<int>(namer_.points_m_.size()); ++a) {
      const std::vector<int>& near = namer_.neighbours_[static_cast<std::size_t>(a)];
      for (const int b : near) {
        for (const int c : near) {
          if (b == c) continue;
          const ThreePointPoses poses = three_point_poses({point(a), point(b), point(c)}, rays);
          for (int i = 0; i < poses.count; ++i) {
            const Rigid3& pose = poses.camera_from_object[static_cast<std::size_t>(i)];
            if (!namer_.faces(a, pose) || !namer_.faces(b, pose) || !namer_.faces(c, pose))
              continue;
            consider(pose, a);
          }
        }
      }
    }
  }

  int dot_under(const Eigen::Matrix3d& turn, const Vector3d& shift, int point) const {
    const Vector3d seen = turn * namer_.points_m_[static_cast<std::size_t>(point)] + shift;
    return seen.z() > 0.0 ? table_->at(project(plain_, seen)) : -1;
  }

  void consider(const Rigid3& pose, int first) {
    const Eigen::Matrix3d turn = pose.rotation.toRotationMatrix();
    // Besides the three points themselves some neighbour must be on a dot.
    constexpr int fewest_near = 4, fewest = 5;
    int near_hits = 1;
    for (const int point : namer_.neighbours_[static_cast<std::size_t>(first)]) {
      near_hits += dot_under(turn, pose.translation_m, point) >= 0;
    }
    if (near_hits < fewest_near) return;
    std::fill(dot_hit_.begin(), dot_hit_.end(), -1);
    int hits = 0;
    for (int i = 0; i < static_cast<int>(namer_.points_m_.size()); ++i) {
      const int dot = dot_under(turn, pose.translation_m, i);
      if (dot < 0 || !namer_.faces(i, pose)) continue;
      hits += dot_hit_[static_cast<std::size_t>(dot)] < 0;
      dot_hit_[static_cast<std::size_t>(dot)] = i;
    }
    const bool full = best.size() >= kMostHypotheses;
    if (hits < fewest || (full && hits <= best.back().hits)) return;
    constexpr double other_names = 0.34;
    const auto known = std::find_if(best.begin(), best.end(), [&](const Hypothesis& h) {
      return difference(h.point_of_dot, dot_hit_) < other_names;
    });
    if (known != best.end()) {
      if (hits > known->hits) *known = {hits, pose, dot_hit_};
    } else {
      if (full) best.pop_back();
      best.push_back({hits, pose, dot_hit_});
    }
    std::stable_sort(best.begin(), best.end(),
                     [](const Hypothesis& a, const Hypothesis& b) { return a.hits > b.hits; });
  }

  const DotNamer& namer_;
  Camera plain_;
  std::vector<Vector3d> rays_;
  std::vector<std::array<int, 3>> triples_;
  std::size_t next_ = 0;
  std::optional<DotTable> table_;
  std::vector<int> dot_hit_;  // point on each dot
};

std::optional<Naming> DotNamer::search(const Camera& camera, const Matrix2Xd& dots_px,
                                       bool focal_known) const {
  if (dots_px.cols() < kFewestNamed) return std::nullopt;
  Search search(*this, camera, dots_px);
  std::optional<Naming> best;
  while (search.more()) {
    std::vector<Naming> namings;
    for (const Hypothesis& hypothesis : search.best) {
      Naming start;
      start.camera = camera;
      start.camera_from_object = hypothesis.pose;
      if (auto naming = refined(start, dots_px, search.reach_px, focal_known)) {
        namings.push_back(std::move(*naming));
      }
    }
    best = best_of(namings);
    if (best && best->named >= kGoodShare * static_cast<double>(dots_px.cols())) break;
  }
  return best;
}

std::optional<Naming> DotNamer::search_focal(const Camera& camera, const Matrix2Xd& dots_px,
                                             const std::vector<double>& factors) const {
  std::vector<Naming> namings;
  for (const double factor : factors) {
    Camera guess = camera;
    guess.focal_px *= factor;
    if (auto naming = search(guess, dots_px, false)) namings.push_back(std::move(*naming));
  }
  auto best = best_of(namings);
  return best;
}

std::optional<std::string> symmetry_of(const std::vector<Vector3d>& points,
                                       const std::vector<std::string>& names) {
  const auto size = static_cast<int>(points.size());
  if (size < 3) return std::nullopt;
  Vector3d middle = Vector3d::Zero();
  for (const Vector3d& point : points) middle += point / size;
  double extent = 0.0;
  for (const Vector3d& point : points) extent = std::max(extent, (point - middle).norm());
  constexpr double tolerance_of_extent = 0.01;
  const double tolerance = tolerance_of_extent * extent;
  // A turn keeps the middle: two points that it carries somewhere say it.
  const auto arm = [&](int i) -> Vector3d { return points[static_cast<std::size_t>(i)] - middle; };
  int first = 0, second = -1;
  for (int i = 0; i < size; ++i) {
    if (arm(i).norm() > arm(first).norm()) first = i;
  }
  double widest = 0.0;
  for (int i = 0; i < size; ++i) {
    const double across = arm(first).cross(arm(i)).norm();
    if (across > widest) {
      widest = across;
      second = i;
    }
  }
  if (second < 0 || widest < tolerance * extent) return std::nullopt;  // a line
  const auto frame = [](const Vector3d& a, const Vector3d& b) {
    Eigen::Matrix3d axes;
    axes.col(0) = a.normalized();
    axes.col(2) = a.cross(b).normalized();
    axes.col(1) = axes.col(2).cross(axes.col(0));
    return axes;
  };
  const auto image = [&](const Eigen::Matrix3d& turn, int i) {
    for (int j = 0; j < size; ++j) {
      if ((turn * arm(i) - arm(j)).norm() < 2.0 * tolerance) return j;
    }
    return -1;
  };
  for (int i = 0; i < size; ++i) {
    if (std::abs(arm(i).norm() - arm(first).norm()) > tolerance) continue;
    for (int j = 0; j < size; ++j) {
      if ((i == first && j == second) || i == j) continue;
      if (std::abs(arm(j).norm() - arm(second).norm()) > tolerance ||
          std::abs((arm(i) - arm(j)).norm() - (arm(first) - arm(second)).norm()) > tolerance) {
        continue;
      }
      const Eigen::Matrix3d turn =
          frame(arm(i), arm(j)) * frame(arm(first), arm(second)).transpose();
      bool all = turn.allFinite();
      for (int k = 0; k < size && all; ++k) all = image(turn, k) >= 0;
      if (!all) continue;
      const double angle = Eigen::AngleAxisd(turn).angle() * 180.0 / std::numbers::pi;
      return fmt::format(
          "turned by {:.0f} degrees, '{}' falls on '{}' and '{}' on '{}', and so all "
          "others",
          angle, names[static_cast<std::size_t>(first)], names[static_cast<std::size_t>(i)],
          names[static_cast<std::size_t>(second)], names[static_cast<std::size_t>(j)]);
    }
  }
  return std::nullopt;
}

}  // namespace semblance
