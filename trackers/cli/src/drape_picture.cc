#include "drape_picture.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>
#include <opencv2/imgproc.hpp>

#include "semblance/render/renderer.h"

namespace semblance::cli {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr int picture_px = 1000;
/// Obstacles with more triangles are taken for curved bodies and shaded smoothly.
constexpr int curved_triangles = 600;

const Vector3f face_colour(0.10f, 0.20f, 0.46f), back_colour(0.60f, 0.58f, 0.52f);
const Vector3f body_colour(0.42f, 0.27f, 0.15f);

/// From the world to a frame whose z points at the viewer, in units of the picture's radius.
struct View {
  Eigen::Matrix3d rotation;
  Vector3d centre;
  double radius;
  static constexpr double distance = 3.4;

  PointsF operator()(const Points& positions_m) const {
    PointsF out = ((positions_m.rowwise() - centre.transpose()) * rotation.transpose() / radius)
                      .cast<float>();
    out.col(2).array() -= static_cast<float>(distance);
    return out;
  }
};

/// The cloth fills the picture, with room for what it lies on.
View view_of(const Points& cloth_m) {
  View view;
  view.rotation =
      (Eigen::AngleAxisd(0.55, Vector3d::UnitX()) * Eigen::AngleAxisd(-0.6, Vector3d::UnitY()))
          .toRotationMatrix();
  const Points seen = cloth_m * view.rotation.transpose();
  const Vector3d low = seen.colwise().minCoeff(), high = seen.colwise().maxCoeff();
  view.centre = view.rotation.transpose() * (0.5 * (low + high));
  view.radius = std::max(1e-6, 0.62 * (high - low).maxCoeff());
  return view;
}

/// Lines every 5 cm of the fabric; of small and large sheets closer and wider ones.
std::shared_ptr<const Image> line_texture(const Sheet& sheet, const Vector3f& colour) {
  constexpr int size = 2048;
  const Eigen::RowVector2d low = sheet.material_m.colwise().minCoeff();
  const double side = (sheet.material_m.colwise().maxCoeff() - low).maxCoeff();
  double mesh_m = 0.05;
  while (side / mesh_m < 4.0) mesh_m *= 0.2;
  while (side / mesh_m > 60.0) mesh_m *= 2.0;
  const double half_line_m = std::max(0.012 * mesh_m, side / size);
  auto texture = std::make_shared<Image>(size, size, 3);
  const auto off_line = [&](double at_m) {
    return std::abs(at_m - mesh_m * std::round(at_m / mesh_m)) > half_line_m;
  };
  for (int y = 0; y < size; ++y) {
    const bool clear_v = off_line(low.y() + (1.0 - (y + 0.5) / size) * side);
    for (int x = 0; x < size; ++x) {
      const bool clear = clear_v && off_line(low.x() + (x + 0.5) / size * side);
      for (int c = 0; c < 3; ++c) texture->pixel(x, y)[c] = colour[c] * (clear ? 1.0f : 0.55f);
    }
  }
  return texture;
}

/// Triangles of the sheet that show their face (or back) to the viewer.
SceneObject sheet_side(const Sheet& sheet, const Points& positions_m, const View& view, bool face) {
  SceneObject object;
  object.positions_m = view(positions_m);
  vertex_normals(object.positions_m, sheet.triangles, object.normals);
  if (!face) object.normals = -object.normals;
  Mesh mesh = sheet.mesh(positions_m);
  std::vector<int> kept;
  for (int t = 0; t < sheet.triangles.rows(); ++t) {
    const Vector3f a = object.positions_m.row(sheet.triangles(t, 0));
    const Vector3f b = object.positions_m.row(sheet.triangles(t, 1));
    const Vector3f c = object.positions_m.row(sheet.triangles(t, 2));
    if (((b - a).cross(c - a).dot(-a) > 0.0f) == face) kept.push_back(t);
  }
  mesh.triangles = Triangles(sheet.triangles(kept, Eigen::all));
  object.name = face ? "face" : "back";
  object.mesh = std::make_shared<Mesh>(std::move(mesh));
  object.material.texture = line_texture(sheet, face ? face_colour : back_colour);
  return object;
}

/// Every triangle with vertices of its own, so that edges are sharp.
Mesh facets(const Mesh& mesh) {
  Mesh out;
  out.positions_m.resize(3 * mesh.triangle_count(), 3);
  out.triangles.resize(mesh.triangle_count(), 3);
  for (int t = 0; t < mesh.triangle_count(); ++t) {
    for (int k = 0; k < 3; ++k) {
      out.positions_m.row(3 * t + k) = mesh.positions_m.row(mesh.triangles(t, k));
      out.triangles(t, k) = 3 * t + k;
    }
  }
  return out;
}

SceneObject body(const Obstacle& obstacle, double time_s, const View& view) {
  Mesh mesh = obstacle_mesh(obstacle, time_s);
  mesh.uvs.resize(0, 2);
  if (mesh.triangle_count() <= curved_triangles) mesh = facets(mesh);
  SceneObject object;
  object.name = obstacle.name;
  object.positions_m = view(mesh.positions_m);
  vertex_normals(object.positions_m, mesh.triangles, object.normals);
  object.material.colour = body_colour;
  object.mesh = std::make_shared<Mesh>(std::move(mesh));
  return object;
}

cv::Point at(const Eigen::Vector2d& p) {
  return {static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y()))};
}

/// Grey of a compression, as drawn.
cv::Scalar grey(double compression, double largest) {
  return cv::Scalar::all(255.0 * std::clamp(compression / largest, 0.0, 1.0));
}

void draw_scale(cv::Mat& picture, int top, double white, double largest) {
  const int left = 40, right = picture.cols / 2, height = 22;
  for (int x = left; x < right; ++x) {
    cv::line(picture, {x, top}, {x, top + height},
             grey(static_cast<double>(x - left) / (right - left), 1.0));
  }
  cv::putText(picture,
              fmt::format("compression: black 0, white {:.2f} % and more; the largest is {:.2f} %",
                          1e2 * white, 1e2 * largest),
              {left, top + height + 34}, cv::FONT_HERSHEY_SIMPLEX, 0.8, cv::Scalar::all(255), 2,
              cv::LINE_AA);
}

Image to_linear(const cv::Mat& picture) {
  Image out(picture.cols, picture.rows, 3);
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      for (int c = 0; c < 3; ++c) {
        const float s = static_cast<float>(picture.at<cv::Vec3b>(y, x)[2 - c]) / 255.0f;
        out.pixel(x, y)[c] = s <= 0.04045f ? s / 12.92f : std::pow((s + 0.055f) / 1.055f, 2.4f);
      }
    }
  }
  return out;
}

}  // namespace

Image draw_drape(const ClothScene& scene, const Points& positions_m, double time_s) {
  const View view = view_of(positions_m);
  Scene picture;
  for (const bool face : {true, false}) {
    picture.objects.push_back(sheet_side(scene.sheet, positions_m, view, face));
    if (picture.objects.back().mesh->triangle_count() == 0) picture.objects.pop_back();
  }
  for (const Obstacle& obstacle : scene.obstacles) {
    picture.objects.push_back(body(obstacle, time_s, view));
  }
  picture.background.setOnes();
  // Mostly from above and the left, as seen by the viewer.
  picture.light.coefficients[0].setConstant(0.62f);
  picture.light.coefficients[1].setConstant(0.34f);
  picture.light.coefficients[2].setConstant(0.20f);
  picture.light.coefficients[3].setConstant(-0.42f);
  const Camera camera =
      Camera::centred(2 * picture_px, 2 * picture_px, 0.93 * View::distance * picture_px);
  return downsample_half(make_renderer("osmesa")->render(picture, camera, Channel::colour).colour);
}

Image draw_compression(const Sheet& sheet, const Deformation& deformation,
                       const std::vector<double>& elongations) {
  std::vector<double> sorted = elongations;
  std::sort(sorted.begin(), sorted.end());
  const double largest = sorted.empty() ? 0.0 : std::max(0.0, -sorted.front());
  // One spring that is crushed must not hide what the others do.
  const double white = sorted.empty() ? 0.0 : std::max(0.0, -sorted[sorted.size() / 500]);
  const Eigen::RowVector2d low = sheet.material_m.colwise().minCoeff();
  const Eigen::RowVector2d size = sheet.material_m.colwise().maxCoeff() - low;
  constexpr int margin = 40, scale_height = 90;
  const double px_per_m = 1400.0 / size.maxCoeff();
  const int width = std::max(900, static_cast<int>(size.x() * px_per_m) + 2 * margin);
  const int height = static_cast<int>(size.y() * px_per_m) + 2 * margin;
  cv::Mat picture(height + scale_height, width, CV_8UC3, cv::Scalar(110, 80, 50));
  const auto place = [&](int vertex) {
    const Eigen::RowVector2d p = (sheet.material_m.row(vertex) - low) * px_per_m;
    return at({margin + p.x(), height - margin - p.y()});
  };
  const double spacing_px =
      px_per_m * std::sqrt(2.0 * size.prod() / static_cast<double>(sheet.triangles.rows()));
  const int thickness = std::clamp(static_cast<int>(0.45 * spacing_px), 1, 8);
  // The most compressed last, so that nothing hides them.
  std::vector<int> order(elongations.size());
  for (std::size_t e = 0; e < order.size(); ++e) order[e] = static_cast<int>(e);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return elongations[a] > elongations[b]; });
  for (const int e : order) {
    const auto row = deformation.row(e);
    const cv::Scalar colour = grey(-elongations[e], std::max(white, 1e-12));
    if (row.size() == 2) {
      cv::line(picture, place(row[0].vertex), place(row[1].vertex), colour, thickness, cv::LINE_AA);
    } else {
      std::vector<cv::Point> corners;
      for (const StrainEntry& entry : row) corners.push_back(place(entry.vertex));
      cv::fillConvexPoly(picture, corners, colour, cv::LINE_AA);
    }
  }
  draw_scale(picture, height, white, largest);
  return to_linear(picture);
}

}  // namespace semblance::cli
