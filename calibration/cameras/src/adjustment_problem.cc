#include "adjustment_problem.h"

#include <ceres/autodiff_cost_function.h>
#include <ceres/crs_matrix.h>
#include <ceres/loss_function.h>
#include <fmt/format.h>

#include <cmath>

#include "marginals.h"

namespace semblance {
namespace {

using Eigen::MatrixXd;

struct LengthResidual {
  double length_m, weight;
  template <typename T>
  bool operator()(const T* a, const T* b, T* residual) const {
    const Eigen::Map<const Eigen::Vector3<T>> point_a(a), point_b(b);
    residual[0] = weight * ((point_a - point_b).norm() - length_m);
    return true;
  }
};

struct PlaceResidual {
  Eigen::Vector3d position_m;
  double weight;
  template <typename T>
  bool operator()(const T* point, T* residual) const {
    Eigen::Map<Eigen::Vector3<T>> result(residual);
    result = weight * (Eigen::Map<const Eigen::Vector3<T>>(point) - position_m);
    return true;
  }
};

Eigen::SparseMatrix<double> sparse_from_crs(const ceres::CRSMatrix& crs) {
  return Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>>(
      crs.num_rows, crs.num_cols, static_cast<int>(crs.values.size()), crs.rows.data(),
      crs.cols.data(), crs.values.data());
}

}  // namespace

AdjustmentProblem::AdjustmentProblem(const Survey& survey, const AdjustmentOptions& options,
                                     const std::vector<char>& outlier, double sigma_px,
                                     std::optional<double> cauchy_px)
    : points_free_(options.points),
      points_(survey.points_m),
      warp_(survey.warp_m),
      offsets_(survey.time_offset_s) {
  for (const Camera& camera : survey.cameras) {
    lenses_.push_back(camera.lens);
    intrinsics_.push_back(intrinsics_block(camera));
    camera_poses_.push_back(block_from_pose(camera.camera_from_world));
  }
  for (const Rigid3& pose : survey.world_from_target) placements_.push_back(block_from_pose(pose));
  add_sightings(survey, outlier, cauchy_px);
  add_lengths(options.lengths, sigma_px);
  add_known_points(options.known_points, sigma_px);
  set_freedom(options);
}

void AdjustmentProblem::add_sightings(const Survey& survey, const std::vector<char>& outlier,
                                      std::optional<double> cauchy_px) {
  ceres::LossFunction* loss = cauchy_px ? new ceres::CauchyLoss(*cauchy_px) : nullptr;
  const Eigen::AlignedBox3d box = points_box(survey);
  for (std::size_t i = 0; i < survey.sightings.size(); ++i) {
    if (outlier[i]) continue;
    const Sighting& sighting = survey.sightings[i];
    const auto camera = static_cast<std::size_t>(sighting.camera);
    Eigen::Vector3d& point = points_[static_cast<std::size_t>(sighting.point)];
    problem_.AddResidualBlock(new Reprojection(lenses_[camera], sighting, warp_shape(point, box)),
                              loss, intrinsics_[camera].data(), camera_poses_[camera].data(),
                              placements_[static_cast<std::size_t>(sighting.placement)].data(),
                              point.data(), warp_.data(), &offsets_[camera]);
  }
}

void AdjustmentProblem::add_lengths(const std::vector<KnownLength>& lengths, double sigma_px) {
  for (const KnownLength& known : lengths) {
    for (const int end : {known.point_a, known.point_b}) {
      length_ends_.insert(points_[static_cast<std::size_t>(end)].data());
    }
    problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<LengthResidual, 1, 3, 3>(
                                  new LengthResidual{known.length_m, sigma_px / known.sigma_m}),
                              nullptr, points_[static_cast<std::size_t>(known.point_a)].data(),
                              points_[static_cast<std::size_t>(known.point_b)].data());
  }
}

void AdjustmentProblem::add_known_points(const std::vector<KnownPoint>& points, double sigma_px) {
  for (const KnownPoint& known : points) {
    problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<PlaceResidual, 3, 3>(
                                  new PlaceResidual{known.position_m, sigma_px / known.sigma_m}),
                              nullptr, points_[static_cast<std::size_t>(known.point)].data());
  }
}

void AdjustmentProblem::free_pose(PoseBlock& block, bool is_free) {
  if (!problem_.HasParameterBlock(block.data())) return;
  if (is_free) {
    problem_.SetManifold(block.data(), new PoseManifold);
  } else {
    problem_.SetParameterBlockConstant(block.data());
  }
}

void AdjustmentProblem::free_intrinsics(std::vector<double>& block, const CameraFreedom& freedom) {
  if (!problem_.HasParameterBlock(block.data())) return;
  std::vector<int> kept;
  const int size = static_cast<int>(block.size());
  for (int i = 0; i < size; ++i) {
    const bool is_free = i == 0   ? freedom.focal
                         : i == 1 ? freedom.aspect
                         : i < 4  ? freedom.principal
                                  : freedom.distortion;
    if (!is_free) kept.push_back(i);
  }
  if (static_cast<int>(kept.size()) == size) {
    problem_.SetParameterBlockConstant(block.data());
  } else if (!kept.empty()) {
    problem_.SetManifold(block.data(), new ceres::SubsetManifold(size, kept));
  }
}

void AdjustmentProblem::set_freedom(const AdjustmentOptions& options) {
  for (std::size_t i = 0; i < intrinsics_.size(); ++i) {
    const CameraFreedom& freedom = options.cameras[i];
    free_intrinsics(intrinsics_[i], freedom);
    free_pose(camera_poses_[i], freedom.pose);
    if (!freedom.time_offset && problem_.HasParameterBlock(&offsets_[i])) {
      problem_.SetParameterBlockConstant(&offsets_[i]);
    }
  }
  for (std::size_t i = 0; i < placements_.size(); ++i) {
    const bool is_kept = options.kept_placement == static_cast<int>(i);
    free_pose(placements_[i], options.placements && !is_kept);
  }
  for (Eigen::Vector3d& point : points_) {
    if (!options.points && problem_.HasParameterBlock(point.data())) {
      problem_.SetParameterBlockConstant(point.data());
    }
  }
  if (!options.warp && problem_.HasParameterBlock(warp_.data())) {
    problem_.SetParameterBlockConstant(warp_.data());
  }
}

bool AdjustmentProblem::is_free(const double* block) const {
  return problem_.HasParameterBlock(block) &&
         !problem_.IsParameterBlockConstant(const_cast<double*>(block));
}

void AdjustmentProblem::add_free(double* block, std::string name,
                                 std::vector<FreeBlock>& blocks) const {
  if (is_free(block)) blocks.push_back({block, std::move(name)});
}

std::vector<AdjustmentProblem::FreeBlock> AdjustmentProblem::kept_blocks() {
  std::vector<FreeBlock> blocks;
  for (std::size_t i = 0; i < intrinsics_.size(); ++i) {
    add_free(intrinsics_[i].data(), fmt::format("focal length, centre or lens of camera {}", i),
             blocks);
    add_free(camera_poses_[i].data(), fmt::format("the pose of camera {}", i), blocks);
    add_free(&offsets_[i], fmt::format("the time offset of camera {}", i), blocks);
  }
  add_free(warp_.data(), "the warp of the target", blocks);
  if (points_free_) {
    add_free_placements(blocks);
    add_free_points(true, blocks);
  }
  return blocks;
}

std::vector<AdjustmentProblem::FreeBlock> AdjustmentProblem::eliminated_blocks() {
  std::vector<FreeBlock> blocks;
  if (points_free_) {
    add_free_points(false, blocks);
  } else {
    add_free_placements(blocks);
  }
  return blocks;
}

void AdjustmentProblem::add_free_points(bool length_ends, std::vector<FreeBlock>& blocks) {
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (is_length_end(points_[i].data()) != length_ends) continue;
    add_free(points_[i].data(), fmt::format("point {}", i), blocks);
  }
}

// The ends of a known length share a residual, and cannot be eliminated one by one.
bool AdjustmentProblem::is_length_end(const double* point) const {
  return length_ends_.count(point) > 0;
}

void AdjustmentProblem::add_free_placements(std::vector<FreeBlock>& blocks) {
  for (std::size_t i = 0; i < placements_.size(); ++i) {
    add_free(placements_[i].data(), fmt::format("placement {} of the target", i), blocks);
  }
}

std::shared_ptr<ceres::ParameterBlockOrdering> AdjustmentProblem::ordering() const {
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  std::vector<double*> blocks;
  problem_.GetParameterBlocks(&blocks);
  const auto among = [](const auto& group, const double* block) {
    return !group.empty() && block >= group.front().data() && block <= group.back().data();
  };
  for (double* block : blocks) {
    const bool alone =
        points_free_ ? among(points_, block) && !is_length_end(block) : among(placements_, block);
    ordering->AddElementToGroup(block, alone ? 0 : 1);
  }
  return ordering;
}

int AdjustmentProblem::free_parameters() const {
  std::vector<double*> blocks;
  problem_.GetParameterBlocks(&blocks);
  int count = 0;
  for (const double* block : blocks) {
    if (is_free(block)) count += problem_.ParameterBlockTangentSize(block);
  }
  return count;
}

void AdjustmentProblem::write_back(Survey& survey) const {
  for (std::size_t i = 0; i < survey.cameras.size(); ++i) {
    set_intrinsics(intrinsics_[i], survey.cameras[i]);
    survey.cameras[i].camera_from_world = pose_from_block(camera_poses_[i]);
  }
  for (std::size_t i = 0; i < placements_.size(); ++i) {
    survey.world_from_target[i] = pose_from_block(placements_[i]);
  }
  survey.points_m = points_;
  survey.warp_m = warp_;
  survey.time_offset_s = offsets_;
}

Eigen::SparseMatrix<double> AdjustmentProblem::normal_matrix(const std::vector<FreeBlock>& blocks) {
  ceres::Problem::EvaluateOptions evaluate;
  for (const FreeBlock& block : blocks) evaluate.parameter_blocks.push_back(block.values);
  ceres::CRSMatrix crs;
  problem_.Evaluate(evaluate, nullptr, nullptr, nullptr, &crs);
  const Eigen::SparseMatrix<double> jacobian = sparse_from_crs(crs);
  return jacobian.transpose() * jacobian;
}

MatrixXd AdjustmentProblem::intrinsics_by_step(const std::vector<double>& block) const {
  const auto size = static_cast<Eigen::Index>(block.size());
  MatrixXd by_block = MatrixXd::Identity(size, size);  // fy = focal * aspect
  by_block(1, 0) = block[1];
  by_block(1, 1) = block[0];
  const ceres::Manifold* manifold = problem_.GetManifold(block.data());
  if (manifold == nullptr) return by_block;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> by_step(
      size, manifold->TangentSize());
  manifold->PlusJacobian(block.data(), by_step.data());
  return by_block * by_step;
}

std::optional<AdjustmentCovariance> AdjustmentProblem::covariance(double sigma_px,
                                                                  std::string& undetermined) {
  std::vector<FreeBlock> blocks = kept_blocks();
  const std::size_t kept = blocks.size();
  const std::vector<FreeBlock> eliminated = eliminated_blocks();
  blocks.insert(blocks.end(), eliminated.begin(), eliminated.end());
  std::vector<BlockColumns> columns;
  int first = 0;
  for (const FreeBlock& block : blocks) {
    columns.push_back({first, problem_.ParameterBlockTangentSize(block.values)});
    first += columns.back().size;
  }
  const Marginals marginals = marginal_inverse(normal_matrix(blocks), columns, kept);
  if (marginals.loose >= 0) {
    undetermined = blocks[static_cast<std::size_t>(marginals.loose)].name;
    return std::nullopt;
  }
  std::map<const double*, MatrixXd> known;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    known[blocks[i].values] = sigma_px * sigma_px * marginals.blocks[i];
  }
  return covariance_from(known);
}

AdjustmentCovariance AdjustmentProblem::covariance_from(
    const std::map<const double*, MatrixXd>& known) const {
  const auto of = [&](const double* block, Eigen::Index size) -> MatrixXd {
    const auto found = known.find(block);
    return found == known.end() ? MatrixXd::Zero(size, size) : found->second;
  };
  AdjustmentCovariance result;
  for (std::size_t i = 0; i < intrinsics_.size(); ++i) {
    const auto size = static_cast<Eigen::Index>(intrinsics_[i].size());
    const MatrixXd by_step = is_free(intrinsics_[i].data()) ? intrinsics_by_step(intrinsics_[i])
                                                            : MatrixXd::Zero(size, size);
    result.cameras.push_back(
        {by_step * of(intrinsics_[i].data(), by_step.cols()) * by_step.transpose(),
         of(camera_poses_[i].data(), 6), std::sqrt(of(&offsets_[i], 1)(0, 0))});
  }
  for (const PoseBlock& pose : placements_) result.placements.push_back(of(pose.data(), 6));
  if (points_free_) {
    for (const Eigen::Vector3d& point : points_) result.points.push_back(of(point.data(), 3));
  }
  result.warp = of(warp_.data(), 3);
  return result;
}

}  // namespace semblance
