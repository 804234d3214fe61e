// The cost of a bundle of keyframes: what FaceBundle minimises.
#pragma once

#include <array>
#include <vector>

#include "face_parts.h"
#include "semblance/cost/contour.h"
#include "semblance/face/face_bundle.h"
#include "semblance/optim/objective.h"

namespace semblance {

/// Where everything is in the bundle's vector: the identity, then for each keyframe its pose,
/// expression and light.
struct BundleLayout {
  /// Coefficients of a keyframe's light: the logarithm of its encoded light relative to the light
  /// common to all, in the basis of sh_basis.
  static constexpr int light_size = 9;

  BundleLayout(const ParameterSpace& model, int identities, std::size_t keyframes);

  /// The model's vector of keyframe k, and its light.
  Eigen::VectorXd model_vector(const Eigen::VectorXd& x, std::size_t k) const;
  Eigen::VectorXd light(const Eigen::VectorXd& x, std::size_t k) const;
  /// The bundle's vector, without own lights, for models' vectors that share the first's identity.
  Eigen::VectorXd join(const std::vector<Eigen::VectorXd>& models) const;
  /// Tangent entry of the bundle for each tangent entry of keyframe k's model, then of its light.
  std::vector<Eigen::Index> tangent(std::size_t k) const;
  /// The same without those of its light.
  std::vector<Eigen::Index> model_tangent(std::size_t k) const;

  Eigen::Index identity_size, own_size;  // own: pose and expression of one keyframe
  ParameterSpace space;

 private:
  Eigen::Index first(std::size_t k) const {
    return identity_size + static_cast<Eigen::Index>(k) * (own_size + light_size);
  }
};

/// What stays the same through all rounds of an adjustment, but for the light.
struct BundleProblem {
  const FaceFitter& fitter;
  const MorphModel& model;
  const std::vector<float>& triangle_weight;
  const std::vector<ContourEdge>& contour;
  const std::vector<GenericColour>& colour;
  Camera camera;  // of full resolution
  ShLight light;  // common to all keyframes; renewed between rounds
  const std::vector<Keyframe>& keyframes;
  const BundleLayout& layout;
};

/// The bundle at one level of the pyramids. The albedo of a triangle's middle is free: it is the
/// robust mean of what the keyframes show there, and its marginal, the Schur complement, is what
/// the normal equations hold. The outline is compared with the edge of the colours in each keyframe
/// (find_contour). What is visible, and the direction of each normal to the light, are
/// those at the start, so that the cost is smooth; what a turn does to shading is left to the
/// keyframe's own light, which would explain it anyway.
class BundleObjective : public Objective {
 public:
  /// `sigma`: deviation of encoded intensities of the same place between keyframes.
  BundleObjective(const BundleProblem& problem, int level, const Eigen::VectorXd& start,
                  double sigma);

  const ParameterSpace& space() const override { return problem_.layout.space; }
  double evaluate(const Eigen::VectorXd& x) const override;
  bool normal_equations(const Eigen::VectorXd& x, NormalEquations& out) const override;

  /// Robust deviation of what the keyframes show of the same place.
  double deviation(const Eigen::VectorXd& x) const;
  /// Lights of the keyframes, in colour, that agree best with the mean albedo.
  std::vector<ShLight> lights(const Eigen::VectorXd& x) const;
  /// The light under which all keyframes show a face of the generic colours. Turning shows it from
  /// all sides; one keyframe leaves it open where no normal points.
  ShLight common_light(const Eigen::VectorXd& x) const;

 private:
  /// What one keyframe sees at the start.
  struct View {
    std::vector<int> triangle;
    std::vector<float> size;                     // share of the picture, in independent residuals
    std::vector<Eigen::Vector3f> root_of_light;  // of the common light, encoded
    std::vector<std::array<float, 9>> basis;
    std::vector<ContourTarget> contour;
  };
  /// The albedo it shows at the middles of those triangles.
  struct Samples {
    std::vector<float> albedo;  // encoded grey
    std::vector<float> weight;  // size over the variance of `albedo`
    std::vector<Eigen::Vector3f> encoded, root_of_light;
    /// Row i: derivatives of albedo[i] by the model's tangent entries; albedo_term adds the
    /// light's.
    Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> jacobian;
    NormalEquations contour;  // of the outline, by the model's tangent entries
  };
  /// One keyframe's view of a triangle: entry `index` of its lists.
  struct Sighting {
    std::size_t view, index;
  };
  /// The albedo of one triangle's middle: robust mean, robust weights, robust cost.
  struct Mean {
    double value = 0.0, total_weight = 0.0, cost = 0.0;
    std::vector<double> weight;
  };

  Camera camera(std::size_t k) const;
  View look(const Eigen::VectorXd& x, std::size_t k) const;
  std::vector<Samples> sample_all(const Eigen::VectorXd& x, bool with_jacobian) const;
  Samples sample(const Eigen::VectorXd& x, std::size_t k, bool with_jacobian) const;
  void differentiate(const Eigen::VectorXd& x, std::size_t k, const PointsF& positions,
                     const std::vector<float>& slopes, Samples& out) const;
  /// `motion`: of all vertices' pixels; null where only the cost matters.
  void compare_contour(std::size_t k, const PointsF& positions, const VertexJacobian* motion,
                       NormalEquations& out) const;
  void robust_mean(const std::vector<Sighting>& seen, const std::vector<Samples>& samples,
                   Mean& out) const;
  double build(const Eigen::VectorXd& x, NormalEquations* out) const;
  double albedo_term(std::vector<Samples>& samples, NormalEquations* out) const;
  double contour_term(const std::vector<Samples>& samples, NormalEquations* out) const;
  double part_term(const Eigen::VectorXd& x, NormalEquations* out) const;
  double prior_term(const Eigen::VectorXd& x, NormalEquations* out) const;

  BundleProblem problem_;
  int level_;
  double sigma_;
  std::vector<View> views_;
  std::vector<std::vector<Sighting>> sightings_;  // of triangles that two keyframes see
};

}  // namespace semblance
