// The joint cost over intrinsics and the object's pose in each picture.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <vector>

#include "semblance/cost/cost.h"
#include "semblance/object/object_calibration.h"
#include "semblance/optim/objective.h"

namespace semblance {

/// Which intrinsics are sought.
struct IntrinsicsFreedom {
  bool focal = true;  // both axes scaled alike
  bool principal = false, distortion = false;

  int count(Lens lens) const {
    return static_cast<int>(focal) + 2 * static_cast<int>(principal) +
           (distortion ? coefficient_count(lens) : 0);
  }
};

/// A point's pixel, and how it moves: by the free intrinsics, then by a rotation about the camera's
/// axes and a shift of the object.
inline constexpr int kMostParameters = 3 + 8 + 6;  // intrinsics, coefficients, pose
struct PointMotion {
  Eigen::Vector2d pixel_px;
  Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::ColMajor, 2, kMostParameters> by_parameters;
};
PointMotion point_motion(const Camera& camera, const IntrinsicsFreedom& freedom,
                         const Rigid3& camera_from_object, const Eigen::Vector3d& point_m);

/// One picture's camera and pose, for pixels of a comparison at `scale`.
struct PictureView {
  Camera camera;  // scaled
  IntrinsicsFreedom freedom;
  Rigid3 camera_from_object;  // of the target's middle
  double scale = 1.0;

  Eigen::Index parameters() const { return freedom.count(camera.lens) + 6; }
  /// By the parameters of the full picture.
  PointMotion motion(const Eigen::Vector3d& point_m) const;
};

class ColourComparison;
class OutlineComparison;

/// The rasteriser and the equations of one picture, kept from objective to objective.
class ObjectWorkspace {
 public:
  ObjectWorkspace(const ObjectTarget& target, std::size_t pictures);
  ~ObjectWorkspace();
  struct Buffers;
  Buffers& of(std::size_t picture) const { return *buffers_[picture]; }
  const ObjectTarget& target() const { return target_; }

 private:
  const ObjectTarget& target_;
  std::vector<std::unique_ptr<Buffers>> buffers_;
};

/// What one picture is compared with. Pairs are about the target's middle.
struct PictureTerms {
  double scale = 1.0;                          // pixels of the comparison per pixel of the picture
  ShLight light;                               // in the camera's frame
  const OutlineComparison* outline = nullptr;  // may be null, as may be
  const ColourComparison* colours = nullptr;
  std::vector<ObjectPair> pairs;
  double pair_sigma_px = 1.0;
};

/// Sum over the pictures of their costs and pairs. x: the free intrinsics, then rotation and
/// translation of each picture's camera_from_middle.
///
/// The mesh is drawn by a pinhole camera after its vertices were moved, at their depth, to where
/// the lens shows them: triangles are small, so that all between is right too.
class ObjectObjective : public Objective {
 public:
  ObjectObjective(const ObjectWorkspace& workspace, const Camera& camera,
                  const IntrinsicsFreedom& freedom, std::vector<PictureTerms> terms,
                  const std::vector<Rigid3>& start);

  const ParameterSpace& space() const override { return space_; }
  double evaluate(const Eigen::VectorXd& x) const override;
  bool normal_equations(const Eigen::VectorXd& x, NormalEquations& out) const override;

  const Eigen::VectorXd& start() const { return start_; }
  Camera camera(const Eigen::VectorXd& x) const;
  Rigid3 pose(const Eigen::VectorXd& x, std::size_t picture) const;
  /// Tangent entries of a picture: the intrinsics and its pose.
  std::vector<int> columns(std::size_t picture) const;

  /// Calls `use` with the synthesis of one picture at x.
  void with_synthesis(const Eigen::VectorXd& x, std::size_t picture,
                      const std::function<void(const Synthesis&)>& use) const;
  PictureView view(const Eigen::VectorXd& x, std::size_t picture) const;
  /// Adds a cost that lives on the surface; `out` has the size of columns().
  void add_cost(const Eigen::VectorXd& x, std::size_t picture, const Synthesis& synthesis,
                const Cost& cost, NormalEquations& out) const;
  /// The pairs' share of the Hessian.
  Eigen::MatrixXd pairs_information(const Eigen::VectorXd& x) const;

 private:
  void add_pairs(const Eigen::VectorXd& x, std::size_t picture, NormalEquations& out) const;
  double pairs_cost(const Eigen::VectorXd& x, std::size_t picture) const;
  void synthesize(const Eigen::VectorXd& x, std::size_t picture, Scene& scene) const;

  const ObjectWorkspace& workspace_;
  Camera camera_;
  IntrinsicsFreedom freedom_;
  int intrinsics_ = 0;  // free ones
  std::vector<PictureTerms> terms_;
  ParameterSpace space_;
  Eigen::VectorXd start_;
};

}  // namespace semblance
