// Scenes that every renderer test runs over.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "semblance/core/camera.h"
#include "semblance/core/scene.h"

namespace semblance::testing {

struct NamedScene {
  std::string name;
  Scene scene;
  Camera camera;
  /// Share of seen pixels at which renderers may see different triangles: those whose centre lies
  /// within the renderers' rounding of an edge.
  double wrong_share = 0.0;
};

using Triangles = Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// An object with the normals that its positions have.
SceneObject make_object(const std::string& name, const PointsF& positions_m,
                        const Triangles& triangles);
/// (columns + 1) x (rows + 1) vertices given by point(column / columns, row / rows) and their
/// triangles; uvs are the same two numbers.
SceneObject make_grid(const std::string& name, int columns, int rows,
                      const std::function<Eigen::Vector3f(float, float)>& point);
/// An ellipsoid of about a face's size and 2 * columns * rows triangles at the given distance.
SceneObject make_ellipsoid(int columns, int rows, float distance_m);
/// A smooth texture with a different gradient in each channel.
std::shared_ptr<const Image> make_texture(int width, int height);
/// A light whose nine coefficients all matter.
ShLight make_light();

/// Sphere, overlapping triangles, soup, tiny triangles, partly outside, through the near plane, and
/// several textured objects. All from cameras that look at about the origin's -z side.
std::vector<NamedScene> scene_catalogue();

}  // namespace semblance::testing
