// ChArUco and AprilTag sheets: named quads that agree with each other, then the corners.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <set>

#include "charuco_layout.h"
#include "dictionaries.h"
#include "semblance/core/conventions.h"
#include "sheet_detectors.h"
#include "sheet_warp.h"

namespace semblance {

namespace {

using Eigen::Vector2d;

/// The corners of every quad on the sheet, by id.
using QuadLayout = std::map<int, std::array<Vector2d, 4>>;

QuadLayout charuco_layout(const Target& target) {
  QuadLayout layout;
  const double margin = 0.5 * (target.size_m - target.marker_m);
  const std::vector<Eigen::Vector2i> cells = charuco_cells(target);
  for (std::size_t id = 0; id < cells.size(); ++id) {
    const Vector2d corner = target.size_m * cells[id].cast<double>() + Vector2d(margin, margin);
    const double side = target.marker_m;  // OpenCV's order: clockwise from the upper left
    layout[static_cast<int>(id)] = {corner, corner + Vector2d(side, 0),
                                    corner + Vector2d(side, side), corner + Vector2d(0, side)};
  }
  return layout;
}

QuadLayout aprilgrid_layout(const Target& target) {
  QuadLayout layout;
  for (const int id : point_ids(target)) {
    layout[id / 4][id % 4] = point_on_sheet(target, id).head<2>();
  }
  return layout;
}

Vector2d centre_of(const std::array<Vector2d, 4>& quad) {
  return 0.25 * (quad[0] + quad[1] + quad[2] + quad[3]);
}

/// The error of a quad's corners against the warp, in parts of its side.
double misfit(const SheetWarp& warp, const std::array<Vector2d, 4>& sheet, const NamedQuad& quad) {
  double worst = 0.0;
  double side = 0.0;
  for (int k = 0; k < 4; ++k) {
    worst = std::max(worst, (warp.predict(sheet[k]) - quad.corners_px[k]).norm());
    side = std::max(side, (quad.corners_px[(k + 1) % 4] - quad.corners_px[k]).norm());
  }
  return worst / side;
}

void add_quad(SheetWarp& warp, const std::array<Vector2d, 4>& sheet, const NamedQuad& quad) {
  for (int k = 0; k < 4; ++k) warp.add(sheet[k], quad.corners_px[k]);
}

/// The quads that agree with one, found outwards from it: each is predicted by those before it.
std::vector<NamedQuad> grow_group(const std::vector<NamedQuad>& quads, const QuadLayout& layout,
                                  std::size_t seed) {
  constexpr double kTolerance = 0.3;
  std::vector<NamedQuad> group;
  SheetWarp warp;
  std::vector<bool> done(quads.size(), false);
  std::set<int> names;
  const std::size_t none = quads.size();
  for (std::size_t next = seed; next != none;) {
    const NamedQuad& quad = quads[next];
    const auto& sheet = layout.at(quad.id);
    done[next] = true;
    if (group.empty() || (!names.count(quad.id) && misfit(warp, sheet, quad) < kTolerance)) {
      group.push_back(quad);
      names.insert(quad.id);
      add_quad(warp, sheet, quad);
    }
    double nearest = 1e300;
    next = none;
    for (std::size_t i = 0; i < quads.size(); ++i) {
      if (done[i]) continue;
      for (const NamedQuad& member : group) {
        const double distance =
            (centre_of(layout.at(member.id)) - centre_of(layout.at(quads[i].id))).norm();
        if (distance < nearest) {
          nearest = distance;
          next = i;
        }
      }
    }
  }
  return group;
}

/// The largest group of quads that belong to the sheet and agree with each other.
std::vector<NamedQuad> agreeing_quads(const std::vector<NamedQuad>& all, const QuadLayout& layout) {
  std::vector<NamedQuad> quads;
  for (const NamedQuad& quad : all) {
    if (layout.count(quad.id)) quads.push_back(quad);
  }
  std::vector<NamedQuad> best;
  for (std::size_t seed = 0; seed < quads.size(); ++seed) {
    std::vector<NamedQuad> group = grow_group(quads, layout, seed);
    if (group.size() > best.size()) best = std::move(group);
    if (2 * best.size() > quads.size()) break;
  }
  return best;
}

/// Where the edges of a sheet's saddle point run in the picture, and what is bright: `bright` is a
/// direction on the sheet. The contrast is that of the fields at `reach_m` from the place.
std::optional<SaddleLook> expected_look(const cv::Mat& grey, const Eigen::Matrix2d& jacobian,
                                        const Vector2d& place, const Vector2d& bright,
                                        double reach_m) {
  const auto level = [&](const Vector2d& direction) -> std::optional<double> {
    double sum = 0.0;
    for (const double sign : {1.0, -1.0}) {
      const Vector2d p = place + sign * reach_m * (jacobian * direction.normalized());
      const cv::Point at(cvRound(p.x()), cvRound(p.y()));
      if (!cv::Rect(0, 0, grey.cols, grey.rows).contains(at)) return std::nullopt;
      sum += 0.5 * grey.at<std::uint8_t>(at);
    }
    return sum;
  };
  const auto light = level(bright), dark = level({bright.x(), -bright.y()});
  if (!light || !dark || *light <= *dark) return std::nullopt;
  const auto direction = [](const Vector2d& v) { return std::atan2(v.y(), v.x()); };
  SaddleLook look;
  look.bright_rad = direction(jacobian * bright);
  look.edges_rad = {direction(jacobian.col(0)), direction(jacobian.col(1))};
  look.contrast = *light - *dark;
  return look;
}

/// Finds saddle points near places of the sheet, around which `clear_m` shows nothing else.
struct SaddleSearch {
  const cv::Mat& grey;
  double clear_m;

  std::optional<Vector2d> find(const SheetWarp& warp, const Vector2d& sheet, const Vector2d& start,
                               const Vector2d& bright, double reach_m) const {
    constexpr double kLeastRadius = 2.5, kLargestRadius = 8.0;
    const Eigen::Matrix2d jacobian = warp.jacobian(sheet);
    const double scale = std::min(jacobian.col(0).norm(), jacobian.col(1).norm());
    const double radius = std::clamp(clear_m * scale, kLeastRadius, kLargestRadius);
    if (!std::isfinite(radius)) return std::nullopt;
    const auto look = expected_look(grey, jacobian, start, bright, radius / scale);
    if (!look) return std::nullopt;
    const auto place =
        fit_saddle(grey, point_of(start), *look, radius, std::max(2.0, reach_m * scale));
    if (!place) return std::nullopt;
    return vector_of(*place);
  }
};

}  // namespace

void set_points(Detection& detection, const PointsById& points) {
  detection.ids.clear();
  detection.points_px.resize(2, static_cast<Eigen::Index>(points.size()));
  for (const auto& [id, place] : points) {
    detection.points_px.col(static_cast<Eigen::Index>(detection.ids.size())) =
        ours_from_integer_centred(place);
    detection.ids.push_back(id);
  }
}

std::vector<NamedQuad> find_aruco(const cv::Mat& grey, const std::string& dictionary,
                                  bool& inverted) {
  const auto parameters = cv::aruco::DetectorParameters::create();
  std::vector<NamedQuad> best;
  for (const bool invert : {inverted, !inverted}) {
    cv::Mat picture;
    if (invert) {
      cv::bitwise_not(grey, picture);
    } else {
      picture = grey;
    }
    std::vector<std::vector<cv::Point2f>> corners;
    std::vector<int> ids;
    cv::aruco::detectMarkers(picture, dictionary_of(dictionary), corners, ids, parameters);
    if (ids.size() > best.size()) {
      best.resize(ids.size());
      for (std::size_t i = 0; i < ids.size(); ++i) {
        best[i].id = ids[i];
        for (int k = 0; k < 4; ++k) best[i].corners_px[k] = vector_of(corners[i][k]);
      }
      inverted = invert;
    }
    if (best.size() >= 2) break;
  }
  return best;
}

std::vector<NamedQuad> find_tags(const cv::Mat& grey, TagDetector& detector) {
  std::vector<NamedQuad> quads;
  for (const FoundTag& tag : detector.detect(grey.data, grey.cols, grey.rows)) {
    NamedQuad quad;
    quad.id = tag.id;
    for (int k = 0; k < 4; ++k) {
      quad.corners_px[k] = integer_centred_from_ours(tag.corners_px.col(k));
    }
    quads.push_back(quad);
  }
  return quads;
}

void detect_charuco(const cv::Mat& grey, const std::vector<NamedQuad>& quads,
                    Detection& detection) {
  const Target& target = detection.target;
  const QuadLayout layout = charuco_layout(target);
  const std::vector<NamedQuad> group = agreeing_quads(quads, layout);
  // A single marker has nobody to confirm it, and small dictionaries are misread at times.
  if (group.size() < 2) return;
  SheetWarp warp;
  for (const NamedQuad& quad : group) add_quad(warp, layout.at(quad.id), quad);
  const SaddleSearch search{grey, 0.5 * (target.size_m - target.marker_m)};
  const int shift = target.legacy ? (target.rows - 1) % 2 : 0;
  PointsById points;
  for (std::size_t before = 0;; before = points.size()) {
    for (const int id : point_ids(target)) {
      if (points.count(id)) continue;
      const Vector2d sheet = point_on_sheet(target, id).head<2>();
      const Vector2d start = warp.predict(sheet);
      const int column = id % (target.columns - 1), row = id / (target.columns - 1);
      const bool upper_left_black = ((column + row + shift) % 2 == 0) != detection.inverted;
      const Vector2d bright(1.0, upper_left_black ? -1.0 : 1.0);
      const auto place = search.find(warp, sheet, start, bright, 0.15 * target.size_m);
      if (place) points[id] = *place;
    }
    if (points.size() == before) break;
    for (const auto& [id, place] : points) warp.add(point_on_sheet(target, id).head<2>(), place);
  }
  set_points(detection, points);
}

void detect_aprilgrid(const cv::Mat& grey, const std::vector<NamedQuad>& quads,
                      Detection& detection) {
  const Target& target = detection.target;
  const QuadLayout layout = aprilgrid_layout(target);
  const std::vector<NamedQuad> group = agreeing_quads(quads, layout);
  if (group.empty()) return;
  SheetWarp warp;
  for (const NamedQuad& quad : group) add_quad(warp, layout.at(quad.id), quad);
  PointsById outlines;
  for (const NamedQuad& quad : group) {
    for (int k = 0; k < 4; ++k) outlines[4 * quad.id + k] = quad.corners_px[k];
  }
  // Beside a tag's corner its border and the small square between the tags are this wide.
  const double border_m = target.size_m * target.border_bits / (6.0 + 2.0 * target.border_bits);
  const SaddleSearch search{grey, 0.8 * std::min(border_m, target.gap_ratio * target.size_m)};
  PointsById points;
  for (const int id : point_ids(target)) {
    const Vector2d sheet = point_on_sheet(target, id).head<2>();
    const auto outline = outlines.find(id);
    const Vector2d start = outline != outlines.end() ? outline->second : warp.predict(sheet);
    // The tag is black on one diagonal of its corner: white lies on the other.
    const Vector2d bright(1.0, id % 2 == 0 ? 1.0 : -1.0);
    const auto place = search.find(warp, sheet, start, bright, 0.1 * target.size_m);
    if (place) points[id] = *place;
  }
  // Sheets of other makers lack the small squares, and the outlines have to do. They are not mixed
  // with saddle points: where squares touch the corners, blur shifts outlines.
  set_points(detection, 4 * points.size() > outlines.size() ? points : outlines);
}

}  // namespace semblance
