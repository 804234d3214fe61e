#include "semblance/cloth/obstacle.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int arc_steps = 6;  // of drawn quarter circles

void check_length(const std::string& name, const char* what, double value_m, double least_m) {
  if (!(std::isfinite(value_m) && value_m > least_m))
    throw InvalidInput(name + ": the " + what + " is " + std::to_string(value_m) +
                       " m: expected more than " + std::to_string(least_m) + " m");
}

void check_rounding(const std::string& name, double rounding_m, double half_size_m) {
  if (!(rounding_m >= 0.0 && rounding_m < half_size_m))
    throw InvalidInput(name + ": edges cannot be rounded by " + std::to_string(rounding_m) +
                       " m: expected 0 to less than " + std::to_string(half_size_m) + " m");
}

SurfacePoint rounded(const Vector3d& on_core, double signed_distance, const Vector3d& normal,
                     double rounding) {
  return {signed_distance - rounding, on_core + rounding * normal, normal};
}

/// Point of the outline of a lathe: the core's corner and the direction in which rounding goes.
struct Around {
  Vector2d corner_xz;
  double angle;
};
struct Along {
  double y;
  double elevation;
};

/// Surface around the y axis: rings of `along` joined, and flat ends. Triangles that have shrunk
/// to a line are left out.
Mesh lathe(const std::vector<Around>& around, const std::vector<Along>& along, double rounding) {
  Mesh mesh;
  const int n = static_cast<int>(around.size()), rows = static_cast<int>(along.size());
  mesh.positions_m.resize(n * rows, 3);
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < n; ++j) {
      const double c = rounding * std::cos(along[i].elevation);
      mesh.positions_m.row(i * n + j) << around[j].corner_xz.x() + c * std::cos(around[j].angle),
          along[i].y + rounding * std::sin(along[i].elevation),
          around[j].corner_xz.y() + c * std::sin(around[j].angle);
    }
  }
  std::vector<std::array<int, 3>> triangles;
  const auto add = [&](int a, int b, int c) {
    const Vector3d p = mesh.positions_m.row(a), q = mesh.positions_m.row(b),
                   r = mesh.positions_m.row(c);
    const double longest = std::max({(q - p).norm(), (r - q).norm(), (p - r).norm()});
    if ((q - p).cross(r - p).norm() > 1e-9 * longest * longest) triangles.push_back({a, b, c});
  };
  for (int i = 0; i + 1 < rows; ++i) {
    for (int j = 0; j < n; ++j) {
      const int here = i * n + j, next = i * n + (j + 1) % n;
      add(here, here + n, next + n);
      add(here, next + n, next);
    }
  }
  const int top = (rows - 1) * n;
  for (int j = 1; j + 1 < n; ++j) {
    add(0, j, j + 1);
    add(top, top + j + 1, top + j);
  }
  mesh.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t)
    mesh.triangles.row(static_cast<Eigen::Index>(t)) << triangles[t][0], triangles[t][1],
        triangles[t][2];
  return mesh;
}

/// Two rings of a core of that half height, or all those of its rounding.
std::vector<Along> rings(double half_height, double rounding) {
  if (rounding == 0.0) return {{-half_height, 0.0}, {half_height, 0.0}};
  std::vector<Along> result;
  for (int k = -arc_steps; k <= 0; ++k)
    result.push_back({-half_height, 0.5 * M_PI * k / arc_steps});
  for (int k = 0; k <= arc_steps; ++k) result.push_back({half_height, 0.5 * M_PI * k / arc_steps});
  return result;
}

class PlaneSolid : public Solid {
 public:
  SurfacePoint closest(const Vector3d& p) const override {
    return {p.y(), {p.x(), 0.0, p.z()}, Vector3d::UnitY()};
  }
  Mesh mesh() const override {
    constexpr double half_m = 5.0;  // what is drawn of it
    Mesh square;
    square.positions_m.resize(4, 3);
    square.positions_m << -half_m, 0, -half_m, -half_m, 0, half_m, half_m, 0, half_m, half_m, 0,
        -half_m;
    square.triangles.resize(2, 3);
    square.triangles << 0, 1, 2, 0, 2, 3;
    return square;
  }
};

/// Upright prism with a convex outline about the origin. Corner k of the outline lies between the
/// sides whose normals have the angles facing[k] and facing[k + 1].
class Prism : public Solid {
 public:
  Prism(std::vector<Vector2d> outline_xz, std::vector<double> facing, double half_height,
        double rounding)
      : outline_(std::move(outline_xz)), facing_(std::move(facing)), half_height_(half_height) {
    rounding_m = rounding;
    const int n = static_cast<int>(outline_.size());
    std::vector<Around> sharp;
    for (const Vector2d& corner : outline_) sharp.push_back({corner, 0.0});
    const Mesh core = lathe(sharp, rings(half_height, 0.0), 0.0);
    corners_m = core.positions_m;
    faces = core.triangles;
    for (int k = 0; k < n; ++k) {
      const int next = (k + 1) % n;
      edges.push_back({std::min(k, next), std::max(k, next)});
      edges.push_back({n + std::min(k, next), n + std::max(k, next)});
      edges.push_back({k, n + k});
    }
    std::sort(edges.begin(), edges.end());
  }

  Mesh mesh() const override {
    std::vector<Around> around;
    for (std::size_t k = 0; k < outline_.size(); ++k) {
      const double turn = facing_[k + 1] - facing_[k];
      const int steps = rounding_m == 0.0 ? 0 : std::max(1, int(std::ceil(arc_steps * turn / 1.6)));
      for (int i = 0; i <= steps; ++i)
        around.push_back({outline_[k], facing_[k] + turn * i / std::max(steps, 1)});
    }
    return lathe(around, rings(half_height_, rounding_m), rounding_m);
  }

 private:
  std::vector<Vector2d> outline_;
  std::vector<double> facing_;
  double half_height_;
};

std::vector<Vector2d> rectangle(double half_x, double half_z) {
  return {{half_x, half_z}, {-half_x, half_z}, {-half_x, -half_z}, {half_x, -half_z}};
}

class BoxSolid : public Prism {
 public:
  BoxSolid(const Vector3d& half_core, double rounding)
      : Prism(rectangle(half_core.x(), half_core.z()),
              {0.0, 0.5 * M_PI, M_PI, 1.5 * M_PI, 2.0 * M_PI}, half_core.y(), rounding),
        half_(half_core) {}

  SurfacePoint closest(const Vector3d& p) const override {
    const Vector3d inside = p.cwiseMax(-half_).cwiseMin(half_), out = p - inside;
    const double distance = out.norm();
    if (distance > 0.0) return rounded(inside, distance, out / distance, rounding_m);
    Eigen::Index axis;
    const double depth = (half_ - p.cwiseAbs()).minCoeff(&axis);
    const Vector3d normal = std::copysign(1.0, p[axis]) * Vector3d::Unit(axis);
    return rounded(p + depth * normal, -depth, normal, rounding_m);
  }

 private:
  Vector3d half_;
};

std::vector<Vector2d> regular_outline(int sides, double radius) {
  std::vector<Vector2d> corners;
  for (int k = 0; k < sides; ++k) {
    const double angle = 2.0 * M_PI * (k + 0.5) / sides;
    corners.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
  }
  return corners;
}

std::vector<double> regular_facing(int sides) {
  std::vector<double> angles;
  for (int k = 0; k <= sides; ++k) angles.push_back(2.0 * M_PI * k / sides);
  return angles;
}

class RegularPrism : public Prism {
 public:
  RegularPrism(double core_radius, double half_height, int sides, double rounding)
      : Prism(regular_outline(sides, core_radius), regular_facing(sides), half_height, rounding),
        apothem_(core_radius * std::cos(M_PI / sides)),
        half_side_(core_radius * std::sin(M_PI / sides)),
        half_height_(half_height),
        sides_(sides) {
    for (const double angle : regular_facing(sides))
      normals_.emplace_back(std::cos(angle), std::sin(angle));
  }

  SurfacePoint closest(const Vector3d& p) const override {
    // The sector that holds the point has the nearest side, inside as well as outside.
    const double turn = std::atan2(p.z(), p.x()) / (2.0 * M_PI) * sides_;
    const int sector = static_cast<int>(std::lround(turn < 0.0 ? turn + sides_ : turn));
    const Vector2d n = normals_[sector], tangent(-n.y(), n.x()), xz(p.x(), p.z());
    const double beyond = n.dot(xz) - apothem_, above = std::abs(p.y()) - half_height_;
    const double up = std::copysign(1.0, p.y());
    if (beyond <= 0.0 && above <= 0.0) {
      const Vector3d normal = beyond > above ? Vector3d(n.x(), 0, n.y()) : Vector3d(0, up, 0);
      const double depth = -std::max(beyond, above);
      return rounded(p + depth * normal, -depth, normal, rounding_m);
    }
    Vector3d on_core(p.x(), above > 0.0 ? up * half_height_ : p.y(), p.z());
    if (beyond > 0.0) {
      const Vector2d on_side =
          apothem_ * n + std::clamp(tangent.dot(xz), -half_side_, half_side_) * tangent;
      on_core.x() = on_side.x();
      on_core.z() = on_side.y();
    }
    const Vector3d out = p - on_core;
    const double distance = out.norm();
    return rounded(on_core, distance, out / distance, rounding_m);
  }

 private:
  double apothem_, half_side_, half_height_;
  int sides_;
  std::vector<Vector2d> normals_;
};

/// Segment of half length h along y and what is near it; h = 0 is a sphere.
class CapsuleSolid : public Solid {
 public:
  CapsuleSolid(double radius, double half_length) : half_length_(half_length) {
    rounding_m = radius;
    if (half_length > 0.0) {
      corners_m.resize(2, 3);
      corners_m << 0.0, -half_length, 0.0, 0.0, half_length, 0.0;
      edges.push_back({0, 1});
    } else {
      corners_m = Points::Zero(1, 3);
    }
  }

  SurfacePoint closest(const Vector3d& p) const override {
    const Vector3d on_core(0.0, std::clamp(p.y(), -half_length_, half_length_), 0.0);
    const Vector3d out = p - on_core;
    const double distance = out.norm();
    const Vector3d normal = distance > 0.0 ? Vector3d(out / distance) : Vector3d::UnitX();
    return rounded(on_core, distance, normal, rounding_m);
  }

  Mesh mesh() const override {
    std::vector<Around> around;
    constexpr int steps = 8 * arc_steps;
    for (int k = 0; k < steps; ++k) around.push_back({Vector2d::Zero(), 2.0 * M_PI * k / steps});
    std::vector<Along> along;
    constexpr int quarter = 2 * arc_steps;
    for (int k = -quarter; k <= 0; ++k) along.push_back({-half_length_, 0.5 * M_PI * k / quarter});
    for (int k = half_length_ > 0.0 ? 0 : 1; k <= quarter; ++k)
      along.push_back({half_length_, 0.5 * M_PI * k / quarter});
    return lathe(around, along, rounding_m);
  }

 private:
  double half_length_;
};

Obstacle solid_obstacle(const std::string& name, std::shared_ptr<const Solid> solid,
                        const Rigid3& world_from_body) {
  Obstacle obstacle;
  obstacle.name = name;
  obstacle.solid = std::move(solid);
  obstacle.world_from_body = [world_from_body](double) { return world_from_body; };
  return obstacle;
}

}  // namespace

bool is_moving(const Obstacle& obstacle) {
  if (obstacle.vertices) return true;
  if (!obstacle.world_from_body) return false;
  const Rigid3 start = obstacle.world_from_body(0.0);
  for (int k = 1; k <= 5000; ++k) {
    const Rigid3 place = obstacle.world_from_body(0.02 * k);
    if (place.translation_m != start.translation_m ||
        place.rotation.coeffs() != start.rotation.coeffs()) {
      return true;
    }
  }
  return false;
}

Obstacle make_plane(const std::string& name, const Vector3d& point_m, const Vector3d& normal) {
  if (!(normal.norm() > 0.0 && normal.allFinite() && point_m.allFinite()))
    throw InvalidInput(name + ": a plane needs a finite point and a normal that is not zero");
  return solid_obstacle(name, std::make_shared<PlaneSolid>(),
                        {Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitY(), normal), point_m});
}

Obstacle make_box(const std::string& name, const Vector3d& size_m, const Rigid3& world_from_body,
                  double rounding_m) {
  for (int axis = 0; axis < 3; ++axis) check_length(name, "size", size_m[axis], 0.0);
  check_rounding(name, rounding_m, 0.5 * size_m.minCoeff());
  const Vector3d core = (0.5 * size_m.array() - rounding_m).matrix();
  return solid_obstacle(name, std::make_shared<BoxSolid>(core, rounding_m), world_from_body);
}

Obstacle make_prism(const std::string& name, double radius_m, double height_m, int sides,
                    const Rigid3& world_from_body, double rounding_m) {
  check_length(name, "radius", radius_m, 0.0);
  check_length(name, "height", height_m, 0.0);
  if (sides < 3 || sides > 100000)
    throw InvalidInput(name + ": " + std::to_string(sides) + " sides: expected 3 to 100000");
  const double apothem = radius_m * std::cos(M_PI / sides);
  check_rounding(name, rounding_m, std::min(apothem, 0.5 * height_m));
  const double core_radius = (apothem - rounding_m) / std::cos(M_PI / sides);
  return solid_obstacle(
      name,
      std::make_shared<RegularPrism>(core_radius, 0.5 * height_m - rounding_m, sides, rounding_m),
      world_from_body);
}

std::vector<Obstacle> make_drape_tester(const std::string& name, const Vector3d& top_centre_m,
                                        const DrapeTester& tester) {
  const Vector3d down = -Vector3d::UnitY();
  const Rigid3 disc{Eigen::Quaterniond::Identity(),
                    top_centre_m + 0.5 * tester.disc_thickness_m * down};
  const Rigid3 stem{Eigen::Quaterniond::Identity(),
                    top_centre_m + (tester.disc_thickness_m + 0.5 * tester.stem_length_m) * down};
  return {make_prism(name + " disc", tester.disc_radius_m, tester.disc_thickness_m, tester.sides,
                     disc, tester.rounding_m),
          make_prism(name + " stem", tester.stem_radius_m, tester.stem_length_m,
                     std::min(tester.sides, 32), stem)};
}

Obstacle make_sphere(const std::string& name, double radius_m, const Rigid3& world_from_body) {
  check_length(name, "radius", radius_m, 0.0);
  return solid_obstacle(name, std::make_shared<CapsuleSolid>(radius_m, 0.0), world_from_body);
}

Obstacle make_capsule(const std::string& name, double radius_m, double length_m,
                      const Rigid3& world_from_body) {
  check_length(name, "radius", radius_m, 0.0);
  check_length(name, "length", length_m, 0.0);
  return solid_obstacle(name, std::make_shared<CapsuleSolid>(radius_m, 0.5 * length_m),
                        world_from_body);
}

Obstacle make_mesh_obstacle(const std::string& name, Mesh mesh) {
  validate(mesh, name);
  Obstacle obstacle;
  obstacle.name = name;
  obstacle.surface = std::make_shared<const Mesh>(std::move(mesh));
  return obstacle;
}

VertexMotion vertex_frames(std::vector<double> times_s, std::vector<Points> frames_m) {
  if (times_s.empty() || times_s.size() != frames_m.size())
    throw InvalidInput("an animation has " + std::to_string(times_s.size()) + " times and " +
                       std::to_string(frames_m.size()) + " frames: expected one time per frame");
  for (std::size_t k = 1; k < times_s.size(); ++k) {
    if (!(times_s[k] > times_s[k - 1]))
      throw InvalidInput("an animation's times must grow: frame " + std::to_string(k) + " is at " +
                         std::to_string(times_s[k]) + " s");
    if (frames_m[k].rows() != frames_m[0].rows())
      throw InvalidInput("an animation's frame " + std::to_string(k) + " has " +
                         std::to_string(frames_m[k].rows()) + " vertices, the first " +
                         std::to_string(frames_m[0].rows()));
  }
  struct Frames {
    std::vector<double> times;
    std::vector<Points> points;
  };
  auto frames = std::make_shared<const Frames>(Frames{std::move(times_s), std::move(frames_m)});
  return [frames](double time_s, Points& positions_m) {
    const auto after = std::upper_bound(frames->times.begin(), frames->times.end(), time_s);
    if (after == frames->times.begin()) {
      positions_m = frames->points.front();
    } else if (after == frames->times.end()) {
      positions_m = frames->points.back();
    } else {
      const std::size_t k = after - frames->times.begin();
      const double t = (time_s - after[-1]) / (after[0] - after[-1]);
      positions_m = (1.0 - t) * frames->points[k - 1] + t * frames->points[k];
    }
  };
}

Mesh obstacle_mesh(const Obstacle& obstacle, double time_s) {
  Mesh mesh = obstacle.solid ? obstacle.solid->mesh() : *obstacle.surface;
  if (!obstacle.solid && obstacle.vertices) {
    obstacle.vertices(time_s, mesh.positions_m);
  } else if (obstacle.world_from_body) {
    const Rigid3 place = obstacle.world_from_body(time_s);
    for (Eigen::Index v = 0; v < mesh.vertex_count(); ++v)
      mesh.positions_m.row(v) = (place * Vector3d(mesh.positions_m.row(v))).transpose();
  }
  return mesh;
}

}  // namespace semblance
