// Named, bounded, typed parameters over one flat vector.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace semblance {

/// How a block of parameters moves. A rotation is stored as a unit quaternion (w, x, y, z) and
/// moves by a rotation vector applied on the left: q <- exp(d) q.
enum class Manifold { euclidean, rotation };

/// A named group of parameters. Vectors have `size` entries; a rotation has size 4, its bounds are
/// ignored, and its prior is `prior_mean` (a quaternion) with three equal `prior_sigma` in radian.
struct ParameterBlock {
  std::string name;  // "jaw_open", "rotation", "translation"
  int size = 1;
  std::string unit = "1";
  Eigen::VectorXd lower, upper;
  Eigen::VectorXd prior_mean, prior_sigma;  // sigma infinite: no prior
  Manifold manifold = Manifold::euclidean;
  std::string doc;
};

/// A scalar block.
ParameterBlock scalar_block(const std::string& name, const std::string& unit, double lower,
                            double upper, double mean, double sigma, const std::string& doc);
/// The rotation and translation (metre) of an object, without priors.
ParameterBlock rotation_block(const std::string& name, const std::string& doc);
ParameterBlock translation_block(const std::string& name, double limit_m, const std::string& doc);

/// Ordered blocks over one flat vector x. Steps live in the tangent space: `plus(x, d)` moves x by
/// d, which has one entry less than x for every rotation. It alone drives the bounds and step sizes
/// of every optimizer, the priors, `--help` and the columns of result files.
class ParameterSpace {
 public:
  ParameterSpace() = default;
  explicit ParameterSpace(std::vector<ParameterBlock> blocks);

  const std::vector<ParameterBlock>& blocks() const { return blocks_; }
  Eigen::Index size() const { return size_; }
  Eigen::Index tangent_size() const { return tangent_size_; }

  /// Index of the block; throws InvalidInput listing the names there are.
  int block_index(const std::string& name) const;
  /// First entry of a block in x, and in a tangent vector.
  Eigen::Index offset(int block) const { return offsets_[block]; }
  Eigen::Index tangent_offset(int block) const { return tangent_offsets_[block]; }
  static int tangent_size(const ParameterBlock& block) {
    return block.manifold == Manifold::rotation ? 3 : block.size;
  }

  /// Prior means (identity rotation and zero where there is none).
  Eigen::VectorXd initial() const;
  /// x moved by the tangent vector d; euclidean entries are clamped to their bounds.
  Eigen::VectorXd plus(const Eigen::VectorXd& x, const Eigen::VectorXd& d) const;
  /// d such that plus(x0, d) = x, up to the bounds.
  Eigen::VectorXd minus(const Eigen::VectorXd& x, const Eigen::VectorXd& x0) const;
  /// Tangent bounds of d for steps from x0: upper - x0 and lower - x0; +-pi for rotations.
  void tangent_bounds(const Eigen::VectorXd& x0, Eigen::VectorXd& lower,
                      Eigen::VectorXd& upper) const;
  /// The declared prior deviations, in the tangent space (infinite where there is no prior).
  Eigen::VectorXd tangent_prior_sigma() const;
  /// Typical size of a step in each tangent direction: the prior sigma where finite, else a tenth
  /// of the range, else 0.1.
  Eigen::VectorXd tangent_scale() const;

  /// One name per entry of x: "jaw_open", "translation[0]".
  std::vector<std::string> entry_names() const;
  std::vector<std::string> entry_units() const;

 private:
  std::vector<ParameterBlock> blocks_;
  std::vector<Eigen::Index> offsets_, tangent_offsets_;
  Eigen::Index size_ = 0, tangent_size_ = 0;
};

}  // namespace semblance
