// The adjustment as Ceres sees it, and its covariance.
#pragma once

#include <ceres/ordered_groups.h>
#include <ceres/problem.h>

#include <Eigen/SparseCore>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "reprojection.h"
#include "semblance/cameras/adjustment.h"

namespace semblance {

/// The parameter blocks of a survey with one residual per sighting that is not an outlier. It
/// holds copies: `write_back` puts the estimates into the survey.
class AdjustmentProblem {
 public:
  /// `sigma_px`: deviation of a sighting, against which known lengths and points are weighed.
  /// `cauchy_px`: scale of a Cauchy loss; none for plain squares.
  AdjustmentProblem(const Survey& survey, const AdjustmentOptions& options,
                    const std::vector<char>& outlier, double sigma_px,
                    std::optional<double> cauchy_px);

  ceres::Problem& problem() { return problem_; }
  /// The blocks to eliminate first: points where they are sought, otherwise placements.
  std::shared_ptr<ceres::ParameterBlockOrdering> ordering() const;
  int free_parameters() const;
  void write_back(Survey& survey) const;
  /// sigma^2 (J'J)^-1. None where J'J is singular; `undetermined` then says along what.
  std::optional<AdjustmentCovariance> covariance(double sigma_px, std::string& undetermined);

 private:
  // A block that is sought, in the order of the columns of the Jacobian.
  struct FreeBlock {
    double* values;
    std::string name;
  };

  void add_sightings(const Survey& survey, const std::vector<char>& outlier,
                     std::optional<double> cauchy_px);
  void add_lengths(const std::vector<KnownLength>& lengths, double sigma_px);
  void add_known_points(const std::vector<KnownPoint>& points, double sigma_px);
  void set_freedom(const AdjustmentOptions& options);
  void free_pose(PoseBlock& block, bool is_free);
  void free_intrinsics(std::vector<double>& block, const CameraFreedom& freedom);
  bool is_free(const double* block) const;
  // The free blocks that stay when the others are eliminated, then those others.
  std::vector<FreeBlock> kept_blocks();
  std::vector<FreeBlock> eliminated_blocks();
  void add_free_placements(std::vector<FreeBlock>& blocks);
  void add_free_points(bool length_ends, std::vector<FreeBlock>& blocks);
  bool is_length_end(const double* point) const;
  void add_free(double* block, std::string name, std::vector<FreeBlock>& blocks) const;
  Eigen::SparseMatrix<double> normal_matrix(const std::vector<FreeBlock>& blocks);
  // Derivative of fx, fy, cx, cy, coefficients by the free figures of an intrinsics block.
  Eigen::MatrixXd intrinsics_by_step(const std::vector<double>& block) const;
  AdjustmentCovariance covariance_from(const std::map<const double*, Eigen::MatrixXd>& known) const;

  ceres::Problem problem_;
  bool points_free_;
  std::vector<Lens> lenses_;
  std::vector<std::vector<double>> intrinsics_;
  std::vector<PoseBlock> camera_poses_, placements_;
  std::vector<Eigen::Vector3d> points_;
  std::set<const double*> length_ends_;  // points of known lengths
  Eigen::Vector3d warp_;
  std::vector<double> offsets_;
};

}  // namespace semblance
