#include "semblance/cameras/adjustment.h"

#include <ceres/ceres.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>

#include "adjustment_problem.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

// The median of the length of a plane normal error is this many of its deviation.
constexpr double kRayleighMedian = 1.17741002251547;
// Closer than this no sighting is an outlier, however good the others are.
constexpr double kAlwaysGood_px = 0.01;
constexpr int kMostRounds = 6;

// In pixels of ordinary sightings.
std::vector<double> error_lengths(const Survey& survey) {
  std::vector<double> lengths;
  lengths.reserve(survey.sightings.size());
  for (const Sighting& sighting : survey.sightings) {
    lengths.push_back(residual_px(survey, sighting).norm() / sighting.spread);
  }
  return lengths;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// NaN (behind the camera) counts as far.
std::vector<char> beyond(const std::vector<double>& lengths, double limit) {
  std::vector<char> marks;
  for (const double length : lengths) marks.push_back(!(length <= limit));
  return marks;
}

// A free point that one sighting alone counts for has no place: that sighting says nothing.
void leave_out_lonely_points(const Survey& survey, const std::vector<KnownPoint>& known,
                             std::vector<char>& outlier) {
  std::vector<int> counts(survey.points_m.size(), 0);
  for (const KnownPoint& point : known) ++counts[static_cast<std::size_t>(point.point)];
  for (std::size_t i = 0; i < outlier.size(); ++i) {
    counts[static_cast<std::size_t>(survey.sightings[i].point)] += outlier[i] ? 0 : 1;
  }
  for (std::size_t i = 0; i < outlier.size(); ++i) {
    if (counts[static_cast<std::size_t>(survey.sightings[i].point)] < 2) outlier[i] = 1;
  }
}

void check_start(const Survey& survey) {
  for (const Sighting& sighting : survey.sightings) {
    if (residual_px(survey, sighting).allFinite()) continue;
    throw SolverError(
        fmt::format("the adjustment cannot start: point {} of placement {} lies behind camera '{}'",
                    sighting.point, sighting.placement,
                    survey.cameras[static_cast<std::size_t>(sighting.camera)].name));
  }
}

class Stopper final : public ceres::IterationCallback {
 public:
  explicit Stopper(const std::function<bool()>& cancelled) : cancelled_(cancelled) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    return cancelled_ && cancelled_() ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }

 private:
  const std::function<bool()>& cancelled_;
};

// One solve over the sightings that are not outliers, robust if a scale for the loss is given.
void solve(Adjustment& result, const AdjustmentOptions& options, double sigma_px,
           std::optional<double> cauchy_px = std::nullopt) {
  AdjustmentProblem problem(result.survey, options, result.outlier, sigma_px, cauchy_px);
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.linear_solver_ordering = problem.ordering();
  solver.max_num_iterations = options.max_iterations;
  solver.function_tolerance = 1e-14;
  solver.parameter_tolerance = 1e-12;
  solver.gradient_tolerance = 1e-14;
  solver.logging_type = ceres::SILENT;
  Stopper stopper(options.cancelled);
  solver.callbacks.push_back(&stopper);
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem.problem(), &summary);
  if (summary.termination_type == ceres::FAILURE) {
    throw SolverError("the adjustment failed: " + summary.message);
  }
  result.iterations += static_cast<int>(summary.iterations.size());
  result.converged = summary.termination_type == ceres::CONVERGENCE;
  problem.write_back(result.survey);
}

void solve_in_rounds(Adjustment& result, const AdjustmentOptions& options) {
  constexpr double usual_px = 1.0;  // until the first solve says more
  if (!options.outlier_sigmas) return solve(result, options, usual_px);
  const double start_px = std::max(median(error_lengths(result.survey)), kAlwaysGood_px);
  solve(result, options, usual_px, start_px);
  for (int round = 0; round < kMostRounds; ++round) {
    const std::vector<double> lengths = error_lengths(result.survey);
    const double sigma_px = median(lengths) / kRayleighMedian;
    std::vector<char> outlier =
        beyond(lengths, std::max(*options.outlier_sigmas * sigma_px, kAlwaysGood_px));
    if (options.points) {
      leave_out_lonely_points(result.survey, options.known_points, outlier);
    }
    if (round > 0 && outlier == result.outlier) return;
    result.outlier = std::move(outlier);
    solve(result, options, std::max(sigma_px, 1e-9));
  }
}

// Less what known lengths and points determine.
int free_parameters(const Adjustment& result, const AdjustmentOptions& options) {
  constexpr double any_px = 1.0;
  const AdjustmentProblem problem(result.survey, options, result.outlier, any_px, std::nullopt);
  return problem.free_parameters() -
         static_cast<int>(options.lengths.size() + 3 * options.known_points.size());
}

void add_statistics(Adjustment& result, int free_parameters) {
  double all = 0.0, kept = 0.0, weighted = 0.0;
  int count = 0;
  const std::vector<double> lengths = error_lengths(result.survey);
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    const double length_px = lengths[i] * result.survey.sightings[i].spread;
    all += length_px * length_px;
    if (result.outlier[i]) continue;
    kept += length_px * length_px;
    weighted += lengths[i] * lengths[i];
    ++count;
  }
  result.rms_all_px = std::sqrt(all / static_cast<double>(lengths.size()));
  result.rms_px = std::sqrt(kept / std::max(count, 1));
  result.sigma_px = std::sqrt(weighted / std::max(2 * count - free_parameters, 1));
}

}  // namespace

// The centre is -R' t; R turns by exp(w) from the left, t moves by d.
Eigen::Matrix3d centre_covariance(const Camera& camera, const CameraUncertainty& uncertainty) {
  const Eigen::Matrix3d back = camera.camera_from_world.rotation.toRotationMatrix().transpose();
  const Eigen::Vector3d& t = camera.camera_from_world.translation_m;
  Eigen::Matrix3d cross;
  cross << 0.0, -t.z(), t.y(), t.z(), 0.0, -t.x(), -t.y(), t.x(), 0.0;
  Eigen::Matrix<double, 3, 6> by_pose;
  by_pose << -back * cross, -back;
  return by_pose * uncertainty.pose * by_pose.transpose();
}

Adjustment adjust(const Survey& start, const AdjustmentOptions& options) {
  validate(start, "survey");
  if (options.cameras.size() != start.cameras.size()) {
    throw InvalidInput("the adjustment needs to know for every camera what is free");
  }
  check_start(start);
  const auto begin = std::chrono::steady_clock::now();
  Adjustment result;
  result.options = options;
  result.survey = start;
  if (result.survey.time_offset_s.empty()) {
    result.survey.time_offset_s.assign(start.cameras.size(), 0.0);
  }
  result.outlier.assign(start.sightings.size(), 0);
  solve_in_rounds(result, options);
  add_statistics(result, free_parameters(result, options));
  result.solve_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (!options.covariance) return result;
  AdjustmentProblem last(result.survey, options, result.outlier, result.sigma_px, std::nullopt);
  result.covariance = last.covariance(result.sigma_px, result.undetermined);
  return result;
}

}  // namespace semblance
