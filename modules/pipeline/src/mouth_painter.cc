#include "mouth_painter.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace semblance {
namespace {

constexpr double mouth_width_m = 0.051, focal_in_longer_sides = 1.05;
// How many times the opening may be enlarged before the picture of its inside fades, and is gone.
constexpr double stretch_kept = 1.5, stretch_gone = 3.0;
constexpr double least_opening_px = 0.5;
constexpr int coverage_samples = 4;  // per pixel and direction
const Eigen::Vector3f cavity_colour(0.022f, 0.008f, 0.007f);
const Eigen::Vector3f skin_colour(0.62f, 0.40f, 0.30f), lip_colour(0.44f, 0.14f, 0.12f);

double mouth_width_px(const MouthPoints& markers) {
  return (markers.row(4) - markers.row(0)).head<2>().norm();
}

auto inner_contour(const MouthWireframe& wireframe, const MouthPoints& points_px) {
  const int ring = wireframe.ring_size();
  return points_px.middleRows((MouthWireframe::contour_count - 1) * ring, ring);
}

/// How much of each pixel lies inside a polygon, as samples out of coverage_samples^2.
struct Coverage {
  cv::Rect pixels;
  cv::Mat share;  // CV_32F, 0 to 1
};

float near_picture(double at_px, int size) {
  return std::isfinite(at_px) ? float(std::clamp(at_px, -double(size), 2.0 * size)) : 0.0f;
}

Coverage polygon_coverage(const std::vector<Eigen::Vector2d>& polygon_px, int width, int height) {
  std::vector<cv::Point2f> near;  // integers must hold what is far outside, too
  for (const Eigen::Vector2d& p : polygon_px) {
    near.emplace_back(near_picture(p.x(), width), near_picture(p.y(), height));
  }
  Coverage coverage{cv::boundingRect(near) & cv::Rect(0, 0, width, height), {}};
  if (coverage.pixels.empty()) return coverage;
  cv::Mat samples = cv::Mat::zeros(coverage.pixels.size() * coverage_samples, CV_8U);
  std::vector<cv::Point> corners;
  for (const cv::Point2f& p : near) {
    const cv::Point2f at = coverage_samples * (p - cv::Point2f(coverage.pixels.tl()));
    corners.emplace_back(cvFloor(at.x), cvFloor(at.y));  // sample i covers [i, i + 1)
  }
  cv::fillPoly(samples, std::vector<std::vector<cv::Point>>{corners}, cv::Scalar(255));
  // fillPoly takes the border along: half a sample too much on every side.
  cv::Mat shares;
  cv::resize(samples, shares, coverage.pixels.size(), 0.0, 0.0, cv::INTER_AREA);
  shares.convertTo(coverage.share, CV_32F, 1.0 / 255.0);
  return coverage;
}

void darken(const Coverage& coverage, double darkness, Image& picture) {
  for (int y = 0; y < coverage.pixels.height; ++y) {
    for (int x = 0; x < coverage.pixels.width; ++x) {
      const auto share = static_cast<float>(darkness) * coverage.share.at<float>(y, x);
      Eigen::Map<Eigen::Vector3f> pixel(
          picture.pixel(coverage.pixels.x + x, coverage.pixels.y + y));
      pixel += share * (cavity_colour - pixel);
    }
  }
}

ShLight light_from_above() {
  ShLight light;
  light.coefficients[0].setConstant(0.72f);
  light.coefficients[1].setConstant(0.18f);
  light.coefficients[2].setConstant(0.28f);
  return light;
}

}  // namespace

PictureSpace::PictureSpace(int width, int height, double mouth_width_px)
    : camera_(Camera::centred(width, height, focal_in_longer_sides * std::max(width, height))),
      metre_per_px_(mouth_width_m / mouth_width_px) {}

PointsF PictureSpace::world_m(const MouthPoints& points_px) const {
  PointsF world(points_px.rows(), 3);
  for (Eigen::Index i = 0; i < points_px.rows(); ++i) {
    const double depth_m = metre_per_px_ * (camera_.focal_px.x() - points_px(i, 2));
    const Eigen::Vector2d slope =
        (points_px.row(i).head<2>().transpose() - camera_.principal_px) / camera_.focal_px.x();
    world.row(i) =
        Eigen::Vector3d(depth_m * slope.x(), -depth_m * slope.y(), -depth_m).cast<float>();
  }
  return world;
}

double mouth_opening_px(const MouthWireframe& wireframe, const MouthPoints& points_px) {
  const auto contour = inner_contour(wireframe, points_px);
  double twice_area = 0.0;
  for (Eigen::Index i = 0; i < contour.rows(); ++i) {
    const auto a = contour.row(i), b = contour.row((i + 1) % contour.rows());
    twice_area += a.x() * b.y() - a.y() * b.x();
  }
  const double width_px =
      (points_px.row(wireframe.index(0, 4)) - points_px.row(0)).head<2>().norm();
  return std::abs(0.5 * twice_area) / width_px;
}

MouthPainter::MouthPainter(const MouthWireframe& wireframe, const MouthPoints& markers,
                           Image picture)
    : wireframe_(wireframe),
      sheet_(wireframe, markers),
      space_(picture.width, picture.height, mouth_width_px(markers)),
      background_(std::make_shared<const Image>(std::move(picture))),
      textured_(true),
      renderer_(make_renderer("raster")) {
  add_object("face", 0, static_cast<int>(sheet_.triangles().rows()), {{}, background_});
}

MouthPainter::MouthPainter(const MouthWireframe& wireframe, const MouthPoints& markers, int width,
                           int height)
    : wireframe_(wireframe),
      sheet_(wireframe, markers),
      space_(width, height, mouth_width_px(markers)),
      textured_(false),
      renderer_(make_renderer("raster")) {
  scene_.light = light_from_above();
  const int lips = sheet_.lip_triangle_count();
  add_object("lips", 0, lips, {lip_colour, nullptr});
  add_object("skin", lips, sheet_.skin_triangle_count(), {skin_colour, nullptr});
  // As the flat skin that the rings run out into.
  const std::array<float, 9> basis = sh_basis(0.0f, 0.0f, 1.0f);
  Eigen::Vector3f light = Eigen::Vector3f::Zero();
  for (int k = 0; k < 9; ++k) light += scene_.light.coefficients[k] * basis[k];
  Image plain(width, height, 3);
  for (std::size_t i = 0; i < plain.data.size(); ++i) {
    plain.data[i] = skin_colour[int(i % 3)] * light[int(i % 3)];
  }
  background_ = std::make_shared<const Image>(std::move(plain));
}

void MouthPainter::add_object(const char* name, int first_triangle, int triangle_count,
                              const Material& material) {
  auto mesh = std::make_shared<Mesh>();
  mesh->triangles = sheet_.triangles().middleRows(first_triangle, triangle_count);
  mesh->positions_m = space_.world_m(sheet_.rest_px()).cast<double>();
  mesh->uvs = picture_uvs(sheet_.rest_px(), space_.camera().width, space_.camera().height);
  SceneObject object;
  object.name = name;
  object.mesh = std::move(mesh);
  object.material = material;
  scene_.objects.push_back(std::move(object));
}

void MouthPainter::pose() {
  for (SceneObject& object : scene_.objects) {
    object.positions_m = space_.world_m(points_px_);
    vertex_normals(object.positions_m, object.mesh->triangles, object.normals);
  }
}

double MouthPainter::cavity_darkness() const {
  if (!textured_) return 1.0;
  const double seen = mouth_opening_px(wireframe_, sheet_.rest_px());
  const double now = mouth_opening_px(wireframe_, points_px_);
  const double stretch = (now + least_opening_px) / (seen + least_opening_px);
  return std::clamp((stretch - stretch_kept) / (stretch_gone - stretch_kept), 0.0, 1.0);
}

Image MouthPainter::paint(const MouthPoints& markers) {
  sheet_.move(markers, points_px_);
  pose();
  const Frame frame = renderer_->render(scene_, space_.camera(), Channel::colour | Channel::mask);
  Image picture = *background_;
  for (std::size_t i = 0; i < frame.mask.size(); ++i) {
    if (frame.mask[i] != 0) std::copy_n(&frame.colour.data[3 * i], 3, &picture.data[3 * i]);
  }
  std::vector<Eigen::Vector2d> inside;
  const auto contour = inner_contour(wireframe_, points_px_);
  for (Eigen::Index i = 0; i < contour.rows(); ++i) inside.emplace_back(contour.row(i).head<2>());
  darken(polygon_coverage(inside, picture.width, picture.height), cavity_darkness(), picture);
  return picture;
}

}  // namespace semblance
