// A mesh moved by weighted displacement fields, and a rigid motion: faces of every kind.
#pragma once

#include <cstdint>
#include <functional>

#include "semblance/models/parametric_model.h"

namespace semblance {

/// Value and derivative of a field's weight as a function of its one parameter.
struct Weight {
  double value = 0.0, derivative = 0.0;
};

/// One displacement field: every vertex moves by weight(parameter) * displacement. A straight blend
/// shape has weight(t) = t; a homotopy path or a rotation about an axis is a sum of a few fields
/// whose weights are different functions of the same parameter.
struct MorphField {
  int parameter = 0;  // index of the scalar block among `parameters` of MorphShape
  std::function<Weight(double)> weight;  // empty: the identity, weight(t) = t
  std::vector<int> vertices;             // rows that move, ascending
  PointsF displacement_m;                // one row per entry of `vertices`, in the model frame
};

/// All that defines such a face. The model frame is the face's own (core/conventions.h), origin
/// between the eyeballs' centres.
struct MorphShape {
  std::vector<ParameterBlock> parameters;  // scalar blocks, identity first, then expression
  int identity_count = 0;                  // how many of them are identity
  std::shared_ptr<const Mesh> mesh;        // neutral, model frame
  std::vector<MorphField> fields;
  std::vector<ModelLandmark> landmarks;  // the 68 of the iBUG scheme where known
  /// Per vertex: which part of a face it belongs to (FacePart), for initial colours and weights.
  /// Empty where nothing is known.
  std::vector<std::uint8_t> part;
};

/// Parts of a face that differ in colour or reliability.
enum class FacePart : std::uint8_t {
  skin,
  lips,
  brow,
  sclera,
  iris,
  pupil,
  teeth,
  mouth_cavity,
  tongue,
  hair,
  ear,
  neck,
  nostril,
  lashes,
  other
};

/// Throws InvalidInput, naming `source`, unless the mesh is valid, every parameter is a scalar,
/// fields and landmarks point into the mesh, and all figures are finite.
void validate(const MorphShape& shape, const std::string& source);

/// The field of a straight blend shape, from the displacement of every vertex (rows of the mesh);
/// rows shorter than `threshold_m` are left out.
MorphField make_field(int parameter, const PointsF& displacement_m, float threshold_m = 0.0f);

/// Vertex positions in the model frame for the values of the shape's parameters.
PointsF shape_positions(const MorphShape& shape, const Eigen::VectorXd& values);

/// The same shape with its identity parameters fixed at `identity` (one value each) and gone: the
/// displaced neutral is the new neutral. Tracking a known person with it costs the expression only.
/// Throws InvalidInput if the number of values is wrong.
MorphShape with_identity(const MorphShape& shape, const Eigen::VectorXd& identity);

/// Parameters: rotation (world from model), translation (metre), then the shape's own blocks. The
/// model is placed by p_world = R p_model + t.
class MorphModel : public ParametricModel {
 public:
  /// Throws InvalidInput if the shape is not valid.
  explicit MorphModel(MorphShape shape);

  const ParameterSpace& parameters() const override { return space_; }
  void synthesize(const Eigen::VectorXd& x, Scene& scene) const override;
  bool vertex_jacobian(const Eigen::VectorXd& x, const std::vector<int>& tangent_columns,
                       const std::vector<int>* vertices, VertexJacobian& out) const override;
  bool image_jacobian(const Eigen::VectorXd& x, const std::vector<int>& tangent_columns,
                      const std::vector<int>& vertices,
                      const std::vector<ImageFromWorld>& image_from_world,
                      VertexJacobian& out) const override;
  const std::vector<ModelLandmark>& landmarks() const override { return shape_.landmarks; }

  const MorphShape& shape() const { return shape_; }

  /// Parameters 0 and 1 are the pose; shape block i is block 2 + i of parameters().
  static constexpr int first_shape_block = 2;

 private:
  struct Tables;  // the fields again, laid out for the two loops
  struct Motion;  // all vertices' derivatives at one x

  MorphShape shape_;
  ParameterSpace space_;
  std::shared_ptr<const Tables> tables_;
};

}  // namespace semblance
