#include "semblance/models/parametric_model.h"

#include "semblance/core/errors.h"

namespace semblance {

const std::vector<ModelLandmark>& ParametricModel::landmarks() const {
  static const std::vector<ModelLandmark> none;
  return none;
}

bool ParametricModel::image_jacobian(const Eigen::VectorXd& x,
                                     const std::vector<int>& tangent_columns,
                                     const std::vector<int>& vertices,
                                     const std::vector<ImageFromWorld>& image_from_world,
                                     VertexJacobian& out) const {
  VertexJacobian in_world;
  if (!vertex_jacobian(x, tangent_columns, &vertices, in_world)) return false;
  out.setZero();
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    out.block(2 * static_cast<Eigen::Index>(i), 0, 2, in_world.cols()) =
        image_from_world[i] * in_world.middleRows(3 * Eigen::Index{vertices[i]}, 3);
  }
  return true;
}

std::array<int, 3> landmark_vertices(const ModelLandmark& landmark, const Scene& scene) {
  int triangle = landmark.triangle, first_vertex = 0;
  for (const SceneObject& object : scene.objects) {
    const auto& triangles = object.mesh->triangles;
    if (triangle < triangles.rows()) {
      return {first_vertex + triangles(triangle, 0), first_vertex + triangles(triangle, 1),
              first_vertex + triangles(triangle, 2)};
    }
    triangle -= static_cast<int>(triangles.rows());
    first_vertex += static_cast<int>(object.mesh->vertex_count());
  }
  throw InvalidInput("landmark '" + landmark.name + "' names triangle " +
                     std::to_string(landmark.triangle) + ", which the scene does not have");
}

Eigen::Vector3d landmark_position(const ModelLandmark& landmark, const Scene& scene) {
  const std::array<int, 3> vertices = landmark_vertices(landmark, scene);
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  for (int corner = 0; corner < 3; ++corner) {
    int vertex = vertices[corner];
    const SceneObject* object = scene.objects.data();
    while (vertex >= object->mesh->vertex_count()) {
      vertex -= static_cast<int>(object->mesh->vertex_count());
      ++object;
    }
    position +=
        landmark.barycentric[corner] * object->positions_m.row(vertex).cast<double>().transpose();
  }
  return position;
}

}  // namespace semblance
