// What a model must do to be rendered and fitted.
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <string>
#include <vector>

#include "semblance/core/scene.h"
#include "semblance/optim/parameter_space.h"

namespace semblance {

/// A named point on a model: a place inside a triangle (numbered through the scene).
struct ModelLandmark {
  std::string name;
  int triangle = 0;
  std::array<float, 3> barycentric{1, 0, 0};
};

/// The landmark's three vertices, numbered through the scene like the rows of a VertexJacobian
/// (divided by three). Throws InvalidInput if the scene has no such triangle.
std::array<int, 3> landmark_vertices(const ModelLandmark& landmark, const Scene& scene);
/// Where the landmark is in the world, for a scene that the model was synthesized into.
Eigen::Vector3d landmark_position(const ModelLandmark& landmark, const Scene& scene);

/// Derivative of world positions with respect to the tangent parameters, for all vertices of the
/// scene numbered through: entry (3 v + axis, p), in metres per unit of the parameter. Rows of a
/// vertex are contiguous.
using VertexJacobian = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
/// Derivative of a vertex's pixel with respect to its world position, in pixels per metre.
using ImageFromWorld = Eigen::Matrix<float, 2, 3, Eigen::RowMajor>;

/// A shape driven by parameters. Deterministic, and its const functions are thread-safe.
///
/// To add a model: implement the two pure functions in one file, and check it with
/// EXPECT_MODEL_CONTRACT (models/contract.h).
class ParametricModel {
 public:
  virtual ~ParametricModel() = default;

  virtual const ParameterSpace& parameters() const = 0;

  /// Poses the model at x in `scene`: sets up `scene.objects` where they are not this model's yet
  /// (their mesh pointers differ), and writes positions and normals. Materials, light and
  /// background of a scene that is already set up are left alone.
  virtual void synthesize(const Eigen::VectorXd& x, Scene& scene) const = 0;

  /// Writes the columns of d(positions)/d(tangent) named by `tangent_columns` (column i of `out` is
  /// parameter tangent_columns[i]) and returns true, or returns false if the model has no
  /// derivatives. `out` is resized where its size differs. `vertices`, where not null, lists the
  /// only vertices whose rows are needed; other rows are left as they are.
  virtual bool vertex_jacobian(const Eigen::VectorXd& x, const std::vector<int>& tangent_columns,
                               const std::vector<int>* vertices, VertexJacobian& out) const {
    (void)x, (void)tangent_columns, (void)vertices, (void)out;
    return false;
  }

  /// The motion of vertices in the image: rows 2 i and 2 i + 1 of `out` are image_from_world[i]
  /// times the three rows of vertices[i] in the VertexJacobian, in as many columns; the columns of
  /// `out` past those are zero. `out` has two rows per listed vertex. Returns false like
  /// vertex_jacobian. Worth overriding where the three rows need not be written for it.
  virtual bool image_jacobian(const Eigen::VectorXd& x, const std::vector<int>& tangent_columns,
                              const std::vector<int>& vertices,
                              const std::vector<ImageFromWorld>& image_from_world,
                              VertexJacobian& out) const;

  /// Named points, possibly none.
  virtual const std::vector<ModelLandmark>& landmarks() const;
};

}  // namespace semblance
