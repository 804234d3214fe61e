#include "semblance/models/sweep_file.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>

#include "semblance/core/errors.h"
#include "semblance/io/json_file.h"
#include "semblance/io/json_reader.h"
#include "semblance/io/outline_io.h"

namespace semblance {
namespace {

using Eigen::Matrix2Xd;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double degree = std::numbers::pi / 180.0;

std::shared_ptr<const SpaceCurve> read_trajectory(JsonReader& in) {
  std::string kind;
  in.text("kind", kind);
  if (kind == "line") {
    Vector3d from = Vector3d::Zero(), to = Vector3d::UnitY();
    in.vector("from_m", from);
    in.vector("to_m", to);
    in.check();
    return make_line(from, to);
  }
  if (kind == "helix") {
    Vector3d centre = Vector3d::Zero(), axis = Vector3d::UnitY(), start = Vector3d::UnitX();
    double angle_deg = 360.0, pitch_m = 0.0;
    in.vector("centre_m", centre);
    in.vector("axis", axis);
    in.vector("start_m", start);
    in.number("angle_deg", angle_deg, -36000.0, 36000.0);
    in.number("pitch_m", pitch_m, -1e6, 1e6);
    in.check();
    return make_helix(centre, axis, start, angle_deg * degree, pitch_m);
  }
  if (kind == "spline") {
    std::vector<Vector3d> points;
    in.vectors("points_m", points);
    in.check();
    return make_spline(points);
  }
  in.fail("kind", "line, helix or spline");
}

/// A contour as the file gives it, before all are brought into correspondence.
struct Outline {
  Matrix2Xd points;
  ContourKind kind = ContourKind::smooth;
  Vector2d offset_m = Vector2d::Zero();
};

Outline read_contour_outline(JsonReader& in, const std::filesystem::path& folder) {
  Outline outline;
  std::string shape, file, id;
  double size_m = 0.0, metres_per_unit = 1.0, turn_deg = 0.0;
  in.text("shape", shape);
  in.number("size_m", size_m, 1e-9, 1e6);
  in.text("file", file);
  in.text("id", id);
  in.number("metres_per_unit", metres_per_unit, 1e-9, 1e6);
  in.check();
  if (shape.empty() == file.empty()) in.fail("shape", "either a 'shape' by name, or a 'file'");
  if (!shape.empty()) {
    if (size_m == 0.0) in.fail("size_m", "the size of the shape in metres");
    outline.points = named_outline(shape, size_m, 720);
    if (shape == "square") outline.kind = ContourKind::polygon;
  } else {
    const std::string path = (folder / file).string();
    outline.points = read_outline(path, id);
    require_simple(outline.points, path);
    outline.points *= metres_per_unit;
    outline.kind = ContourKind::polygon;
  }
  in.choice("kind", {{"smooth", ContourKind::smooth}, {"polygon", ContourKind::polygon}},
            outline.kind);
  in.number("turn_deg", turn_deg, -360.0, 360.0);
  in.vector("offset_m", outline.offset_m);
  const Eigen::Matrix2d turn = Eigen::Rotation2D<double>(turn_deg * degree).toRotationMatrix();
  outline.points = turn * outline.points;
  return outline;
}

SweepContour read_contour(JsonReader& in) {
  SweepContour contour{.contour = PlanarContour(named_outline("circle", 1.0, 3))};
  in.required("position");
  in.number("position", contour.position, 0.0, 1.0);
  in.vector("slope", contour.slope);
  if (in.find("slope_after") != nullptr) {
    contour.slope_after.emplace();
    in.vector("slope_after", *contour.slope_after);
  }
  if (in.find("bias") != nullptr) in.number("bias", contour.bias.emplace(), 1e-6, 1e6);
  return contour;
}

SweepSegment read_segment(JsonReader& in) {
  SweepSegment segment;
  if (const auto* n = in.find("n"); n != nullptr && n->is_number() && n->get<double>() <= -1.0) {
    in.fail("n", fmt::format("a number above -1 (at -1 and below the blend does not reach the next "
                             "contour), not {:g}",
                             n->get<double>()));
  }
  in.number("n", segment.n, -1.0, 1e6);
  in.choice("blend", {{"flat", BlendForm::flat}, {"rational", BlendForm::rational}}, segment.blend);
  in.vectors("features_x", segment.features_x);
  in.vectors("features_y", segment.features_y);
  return segment;
}

}  // namespace

SweepSurface read_sweep(const std::string& path) {
  const nlohmann::json json = read_json_file(path);
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  JsonReader in(json, path);
  std::string schema;
  in.text("schema", schema);
  if (schema != "semblance.sweep/1") in.fail("schema", "\"semblance.sweep/1\"");
  std::shared_ptr<const SpaceCurve> curve = make_line(Vector3d::Zero(), Vector3d::UnitY());
  in.group("trajectory", [&](JsonReader& inner) { curve = read_trajectory(inner); });
  FrameKind frame = FrameKind::rotation_minimising;
  in.choice("frame",
            {{"frenet", FrameKind::frenet},
             {"adapted", FrameKind::adapted},
             {"rotation_minimising", FrameKind::rotation_minimising}},
            frame);
  std::optional<Vector3d> up;
  if (in.find("up") != nullptr) in.vector("up", up.emplace());
  Correspondence correspondence = Correspondence::polar;
  in.choice("correspondence",
            {{"polar", Correspondence::polar},
             {"arc_length", Correspondence::arc_length},
             {"matched", Correspondence::matched}},
            correspondence);
  int point_count = 256;
  in.number("points", point_count, 3, 1024);

  std::vector<Outline> outlines;
  std::vector<SweepContour> contours;
  in.required("contours");
  in.list("contours", [&](JsonReader& inner, std::size_t) {
    if (contours.size() == 1000) throw InvalidInput(path + ": more than 1000 contours");
    outlines.push_back(read_contour_outline(inner, folder));
    contours.push_back(read_contour(inner));
  });
  std::vector<SweepSegment> segments;
  in.list("segments", [&](JsonReader& inner, std::size_t) {
    if (segments.size() == 1000) throw InvalidInput(path + ": more than 1000 segments");
    segments.push_back(read_segment(inner));
  });
  in.finish();
  try {
    std::vector<Matrix2Xd> points;
    for (const Outline& outline : outlines) points.push_back(outline.points);
    points = correspond(points, correspondence, point_count);
    for (std::size_t i = 0; i < contours.size(); ++i) {
      points[i].colwise() += outlines[i].offset_m;
      contours[i].contour = PlanarContour(points[i], outlines[i].kind);
    }
    if (segments.empty() && contours.size() > 1) segments.resize(contours.size() - 1);
    return SweepSurface(MovingFrame(curve, frame, up), std::move(contours), std::move(segments));
  } catch (const InvalidInput& error) {
    throw InvalidInput(path + ": " + error.what());
  }
}

}  // namespace semblance
