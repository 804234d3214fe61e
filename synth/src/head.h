// A dressed, coloured head made of any face model: the scene that clips show.
#pragma once

#include <memory>
#include <vector>

#include "face_colour.h"
#include "lip_paint.h"
#include "semblance/core/rigid3.h"
#include "semblance/models/morph_model.h"
#include "tracer.h"

namespace semblance {

/// Splits a face model by part, bakes colours of its own, adds hair, neck twist and a torso. The
/// model must have the 68 landmarks, parts and texture coordinates. Thread-safe once made.
class SynthHead {
 public:
  /// `texel_m` is the wanted size of the skin texture's texels; `markers` are painted on it. Throws
  /// InvalidInput naming `source` when the model lacks what is needed.
  SynthHead(std::shared_ptr<const MorphModel> model, const PersonLook& look,
            const MarkerSpec& markers, double texel_m, const std::string& source);

  /// The objects at x; objects other than the head's may follow them in `scene`.
  void pose(const Eigen::VectorXd& x, Scene& scene) const;
  /// One entry per object that `pose` sets up.
  const std::vector<Surface>& surfaces() const { return surfaces_; }
  const MorphModel& model() const { return *model_; }
  /// World positions of the 68 landmarks at x.
  std::vector<Eigen::Vector3d> landmarks(const Eigen::VectorXd& x) const;
  /// World positions of the painted dots' centres at x.
  std::vector<Eigen::Vector3d> lip_markers(const Eigen::VectorXd& x) const;

 private:
  /// A subset of the model's triangles with one surface.
  struct Piece {
    std::string name;
    std::shared_ptr<Mesh> mesh;
    std::vector<int> model_vertex;  // per vertex of `mesh`
    Material material;
  };
  void weld();
  void split(const PersonLook& look);
  void bake_skin(const FaceColour& colour, double texel_m);
  void bake_eye(Piece& piece, const FaceColour& colour);
  void grow_hair(const FaceColour& colour, const PersonLook& look);
  void build_torso(const PersonLook& look);
  void measure_ambient();
  Piece cut(const std::string& name, const std::vector<int>& triangles) const;
  void shape_head(const Eigen::VectorXd& x, PointsF& positions_m, PointsF& normals) const;
  void smooth_normals(const PointsF& positions_m, PointsF& normals) const;

  std::shared_ptr<const MorphModel> model_;
  NeutralLandmarks neutral_landmarks_;
  LipPaint paint_;
  std::vector<Piece> pieces_;
  Piece torso_;
  std::vector<Surface> surfaces_;
  std::vector<int> welded_;  // per vertex, the vertex that stands for all at its place
  Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor> welded_triangles_;  // of the skin alone
  std::vector<float> hair_m_;      // thickness of the hair per vertex
  std::vector<float> neck_share_;  // per vertex, 0 follows the head, 1 follows the torso
};

/// A hand-like object in front of the mouth: palm and fingers in the given colour. `raised` is 1
/// before the mouth and 0 below the picture; `drawn_back_m` moves it along the fingers, to the left
/// in the picture.
SceneObject make_hand(const Rigid3& world_from_model, const Eigen::Vector3d& mouth_world_m,
                      double raised, double drawn_back_m, const Eigen::Vector3f& colour);

}  // namespace semblance
