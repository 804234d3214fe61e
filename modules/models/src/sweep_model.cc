#include "semblance/models/sweep_model.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "semblance/core/errors.h"
#include "semblance/core/rigid3.h"

namespace semblance {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr Index first_control = 7, first_control_tangent = 6;

struct Range {
  double lower, upper;
  const char* unit;
};

// Bounds of a contour's controls, in the order of SweepSurface::controls.
void add_contour_ranges(const SweepSurface& surface, std::size_t i, std::vector<Range>& ranges) {
  const std::vector<SweepContour>& contours = surface.contours();
  const SweepContour& c = contours[i];
  double room = 1.0;
  if (i > 0) room = std::min(room, c.position - contours[i - 1].position);
  if (i + 1 < contours.size()) room = std::min(room, contours[i + 1].position - c.position);
  ranges.push_back(
      {std::max(0.0, c.position - 0.3 * room), std::min(1.0, c.position + 0.3 * room), "1"});
  for (int k = 0; k < (c.slope_after ? 4 : 2); ++k) {
    const double slope = k < 2 ? c.slope[k] : (*c.slope_after)[k - 2];
    ranges.push_back({slope - 5.0, slope + 5.0, "1"});
  }
  if (c.bias) ranges.push_back({*c.bias / 1.5, *c.bias * 1.5, "1"});
  const double radius = c.contour.points().colwise().norm().mean();
  for (const double coordinate : c.contour.points().reshaped()) {
    ranges.push_back({coordinate - 0.5 * radius, coordinate + 0.5 * radius, "m"});
  }
}

ParameterSpace space_of(const SweepSurface& surface) {
  std::vector<Range> ranges;
  for (std::size_t i = 0; i < surface.contours().size(); ++i) {
    add_contour_ranges(surface, i, ranges);
  }
  for (const SweepSegment& segment : surface.segments()) {
    ranges.push_back({0.2 * (1.0 + segment.n) - 1.0, 5.0 * (1.0 + segment.n) - 1.0, "1"});
    for (const auto* features : {&segment.features_x, &segment.features_y}) {
      for (const Eigen::Vector2d& f : *features) ranges.push_back({f.y() - 1.0, f.y() + 1.0, "1"});
    }
  }
  std::vector<ParameterBlock> blocks = {
      rotation_block("rotation", "orientation of the surface: world from model"),
      translation_block("translation", 10.0, "place of the surface's origin")};
  const std::vector<std::string> names = surface.control_names();
  const VectorXd values = surface.controls();
  for (std::size_t k = 0; k < names.size(); ++k) {
    blocks.push_back(scalar_block(names[k], ranges[k].unit, ranges[k].lower, ranges[k].upper,
                                  values[static_cast<Index>(k)], INFINITY,
                                  "control of the swept surface (docs/formats/sweep.md)"));
  }
  return ParameterSpace(std::move(blocks));
}

Rigid3 pose_of(const VectorXd& x) {
  return {Eigen::Quaterniond(x[0], x[1], x[2], x[3]).normalized(), x.segment<3>(4)};
}

}  // namespace

SweepModel::SweepModel(SweepSurface surface, int around, int along)
    : surface_(std::move(surface)),
      around_(around),
      along_(along),
      space_(space_of(surface_)),
      mesh_(std::make_shared<Mesh>(surface_.mesh(around, along, false))) {}

SweepSurface SweepModel::surface_at(const VectorXd& x) const {
  if (x.size() != space_.size()) {
    throw InvalidInput("sweep model: " + std::to_string(x.size()) + " parameter values given, " +
                       std::to_string(space_.size()) + " expected");
  }
  SweepSurface surface = surface_;
  surface.set_controls(x.tail(x.size() - first_control));
  return surface;
}

void SweepModel::synthesize(const VectorXd& x, Scene& scene) const {
  const Mesh posed = surface_at(x).mesh(around_, along_, false);
  const Rigid3 world_from_model = pose_of(x);
  if (scene.objects.size() != 1 || scene.objects[0].mesh != mesh_) {
    scene.objects.assign(1, SceneObject{});
    scene.objects[0].name = "sweep";
    scene.objects[0].mesh = mesh_;
  }
  SceneObject& object = scene.objects[0];
  object.positions_m.resize(posed.vertex_count(), 3);
  for (Index v = 0; v < posed.vertex_count(); ++v) {
    object.positions_m.row(v) =
        (world_from_model * Eigen::Vector3d(posed.positions_m.row(v))).cast<float>();
  }
  vertex_normals(object.positions_m, mesh_->triangles, object.normals);
}

bool SweepModel::vertex_jacobian(const VectorXd& x, const std::vector<int>& tangent_columns,
                                 const std::vector<int>* vertices, VertexJacobian& out) const {
  const SweepSurface surface = surface_at(x);
  const Rigid3 world_from_model = pose_of(x);
  const Eigen::Matrix3d rotation = world_from_model.rotation.toRotationMatrix();
  const Index rows = 3 * mesh_->vertex_count(),
              columns = static_cast<Index>(tangent_columns.size());
  if (out.rows() != rows || out.cols() != columns) out.resize(rows, columns);
  std::vector<int> all;
  if (vertices == nullptr) {
    all.resize(static_cast<std::size_t>(mesh_->vertex_count()));
    std::iota(all.begin(), all.end(), 0);
    vertices = &all;
  }
  for (const int vertex : *vertices) {
    const int row = vertex / around_;
    const int segment = std::min(row / along_, surface.segment_count() - 1);
    const double v = double(row - segment * along_) / along_;
    const double u = 2.0 * std::numbers::pi * (vertex % around_) / around_;
    const Eigen::Matrix3Xd shape = rotation * surface.derivatives(u, segment, v);
    const Eigen::Vector3d arm = rotation * surface.at(u, segment, v).position_m;
    for (Index c = 0; c < columns; ++c) {
      const int column = tangent_columns[static_cast<std::size_t>(c)];
      Eigen::Vector3d motion;
      if (column < 3) {
        motion = Eigen::Vector3d::Unit(column).cross(arm);
      } else if (column < first_control_tangent) {
        motion = Eigen::Vector3d::Unit(column - 3);
      } else {
        motion = shape.col(column - first_control_tangent);
      }
      out.block<3, 1>(3 * Index{vertex}, c) = motion.cast<float>();
    }
  }
  return true;
}

}  // namespace semblance
