#include "semblance/cameras/judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "next_view.h"
#include "projection_map.h"
#include "rays.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

constexpr int kParts = 5;
constexpr double kPoorCoverage = 0.45, kPoorSigma_px = 1.0, kPoorHeldOut = 1.5;

struct SquareSum {
  double sum = 0.0;
  int count = 0;

  void add(double square) {
    sum += square;
    ++count;
  }
  double rms() const { return std::sqrt(sum / std::max(count, 1)); }
};

// A part of a survey: the placements chosen, with those of their sightings that `use` takes.
template <class Use>
Survey part_of(const Adjustment& whole, const std::set<int>& placements, const Use& use) {
  Survey part = whole.survey;
  part.world_from_target.clear();
  part.sightings.clear();
  std::map<int, int> index;
  for (std::size_t i = 0; i < whole.survey.sightings.size(); ++i) {
    Sighting sighting = whole.survey.sightings[i];
    if (whole.outlier[i] || placements.count(sighting.placement) == 0 || !use(i)) continue;
    const auto [entry, is_new] =
        index.try_emplace(sighting.placement, static_cast<int>(index.size()));
    if (is_new) {
      const auto placement = static_cast<std::size_t>(sighting.placement);
      part.world_from_target.push_back(whole.survey.world_from_target[placement]);
    }
    sighting.placement = entry->second;
    part.sightings.push_back(sighting);
  }
  return part;
}

// Residuals of every other sighting of a placement, placed by the rest.
void test_placement(const Adjustment& whole, int placement, const std::vector<Camera>& cameras,
                    int parity, std::vector<SquareSum>& out) {
  constexpr std::size_t fewest = 4;
  const auto half = [&](int wanted) {
    int seen = 0;
    return part_of(whole, {placement}, [&](std::size_t) { return seen++ % 2 == wanted; });
  };
  Survey known = half(parity), unknown = half(1 - parity);
  if (known.sightings.size() < fewest || unknown.sightings.empty()) return;
  known.cameras = unknown.cameras = cameras;
  AdjustmentOptions options;
  options.cameras.assign(cameras.size(), CameraFreedom::none());
  options.outlier_sigmas.reset();
  options.covariance = false;
  unknown.world_from_target = adjust(known, options).survey.world_from_target;
  for (const Sighting& sighting : unknown.sightings) {
    const double square = residual_px(unknown, sighting).squaredNorm();
    if (std::isfinite(square)) out[static_cast<std::size_t>(sighting.camera)].add(square);
  }
}

std::vector<SquareSum> held_out_errors(const Adjustment& whole, Progress& progress) {
  std::vector<SquareSum> errors(whole.survey.cameras.size());
  const int count = static_cast<int>(whole.survey.world_from_target.size());
  if (!whole.options.placements || count < 2 * kParts || whole.options.points) return errors;
  AdjustmentOptions options = whole.options;
  options.covariance = false;
  options.outlier_sigmas.reset();
  options.kept_placement.reset();
  progress.begin("testing on views that were left out", kParts);
  for (int part = 0; part < kParts && !progress.cancelled(); ++part) {
    std::set<int> rest;
    for (int p = 0; p < count; ++p) {
      if (p % kParts != part) rest.insert(p);
    }
    const Survey learned =
        adjust(part_of(whole, rest, [](std::size_t) { return true; }), options).survey;
    for (int p = part; p < count; p += kParts) {
      test_placement(whole, p, learned.cameras, 0, errors);
      test_placement(whole, p, learned.cameras, 1, errors);
    }
    progress.update(part + 1);
  }
  progress.end();
  return errors;
}

using PointsOfPlacement = std::map<int, Eigen::Vector3d>;

std::map<int, PointsOfPlacement> points_from_rays(const Adjustment& whole) {
  std::map<std::pair<int, int>, std::vector<Ray>> seen;
  for (std::size_t i = 0; i < whole.survey.sightings.size(); ++i) {
    const Sighting& sighting = whole.survey.sightings[i];
    if (whole.outlier[i]) continue;
    const Camera& camera = whole.survey.cameras[static_cast<std::size_t>(sighting.camera)];
    seen[{sighting.placement, sighting.point}].push_back({&camera, sighting.pixel_px});
  }
  std::map<int, PointsOfPlacement> result;
  for (const auto& [key, rays] : seen) {
    if (rays.size() < 2) continue;
    if (const auto point = point_from_rays(rays)) {
      result[key.first][key.second] = *point;
    }
  }
  return result;
}

std::optional<LengthCheck> check_lengths(const Adjustment& whole) {
  if (whole.options.points || whole.survey.cameras.size() < 2) return std::nullopt;
  LengthCheck check;
  double ratio = 0.0, square = 0.0, length = 0.0;
  for (const auto& [placement, points] : points_from_rays(whole)) {
    // Each point with the next one of the list.
    for (auto a = points.begin(), b = a; a != points.end(); a = b) {
      if (++b == points.end()) break;
      const double true_m =
          (warped_point(whole.survey, a->first) - warped_point(whole.survey, b->first)).norm();
      const double found_m = (a->second - b->second).norm();
      ratio += found_m / true_m - 1.0;
      square += (found_m - true_m) * (found_m - true_m);
      length += true_m;
      ++check.lengths;
    }
  }
  if (check.lengths == 0) return std::nullopt;
  check.scale_error = ratio / check.lengths;
  check.rms_mm = 1e3 * std::sqrt(square / check.lengths);
  check.mean_length_m = length / check.lengths;
  return check;
}

CameraVerdict judge_camera(const Adjustment& whole, int index, const SquareSum& held_out) {
  const Camera& camera = whole.survey.cameras[static_cast<std::size_t>(index)];
  CameraVerdict verdict;
  verdict.counts = Eigen::MatrixXi::Zero(verdict_rows, verdict_columns);
  std::set<int> placements;
  SquareSum errors;
  for (std::size_t i = 0; i < whole.survey.sightings.size(); ++i) {
    const Sighting& sighting = whole.survey.sightings[i];
    if (sighting.camera != index) continue;
    ++verdict.sightings;
    verdict.outliers += whole.outlier[i];
    if (whole.outlier[i]) continue;
    placements.insert(sighting.placement);
    errors.add(residual_px(whole.survey, sighting).squaredNorm());
    const auto cell = [](double at_px, int size_px, int cells) {
      return std::clamp(static_cast<int>(at_px * cells / size_px), 0, cells - 1);
    };
    ++verdict.counts(cell(sighting.pixel_px.y(), camera.height, verdict_rows),
                     cell(sighting.pixel_px.x(), camera.width, verdict_columns));
  }
  verdict.placements = static_cast<int>(placements.size());
  verdict.rms_px = errors.rms();
  verdict.held_out_px = held_out.rms();
  verdict.held_out = held_out.count;
  verdict.coverage = (verdict.counts.array() > 0).cast<double>().mean();
  if (!whole.covariance) return verdict;
  const Eigen::MatrixXd& covariance =
      whole.covariance->cameras[static_cast<std::size_t>(index)].intrinsics;
  if (covariance.isZero(0.0)) return verdict;
  const ProjectionMap map(camera, verdict_rows, verdict_columns);
  verdict.sigma_px = map.sigma_px(covariance);
  verdict.next = next_view(whole, index, map);
  return verdict;
}

void add_warnings(const Adjustment& whole, Verdict& verdict) {
  const auto warn = [&](std::string text) { verdict.warnings.push_back(std::move(text)); };
  if (!whole.converged) warn("the adjustment stopped before it had converged");
  if (!whole.covariance) {
    warn(fmt::format("the pictures leave {} open: no deviation is known", whole.undetermined));
  }
  for (std::size_t i = 0; i < verdict.cameras.size(); ++i) {
    const CameraVerdict& camera = verdict.cameras[i];
    const std::string& name = whole.survey.cameras[i].name;
    const bool sought = camera.sigma_px.size() > 0;
    if (sought && camera.coverage < kPoorCoverage) {
      warn(
          fmt::format("{}: the sheet was shown in {:.0f} % of the picture only; the lens outside "
                      "is a guess",
                      name, 100.0 * camera.coverage));
    }
    if (sought && camera.sigma_px.array().isFinite().select(camera.sigma_px, 0.0).maxCoeff() >
                      kPoorSigma_px) {
      warn(fmt::format("{}: the projection is uncertain by up to {:.1f} px; see the map", name,
                       camera.sigma_px.array().isFinite().select(camera.sigma_px, 0.0).maxCoeff()));
    }
    if (camera.held_out > 0 && camera.held_out_px > kPoorHeldOut * camera.rms_px) {
      warn(
          fmt::format("{}: views that were left out fit {:.2f} px, those fitted to {:.2f} px: the "
                      "lens follows its pictures' errors",
                      name, camera.held_out_px, camera.rms_px));
    }
    if (10 * camera.outliers > camera.sightings) {
      warn(
          fmt::format("{}: {} of {} points are outliers", name, camera.outliers, camera.sightings));
    }
  }
}

}  // namespace

Verdict judge(const Adjustment& adjustment, Progress& progress) {
  Verdict verdict;
  const std::vector<SquareSum> held_out = held_out_errors(adjustment, progress);
  for (std::size_t i = 0; i < adjustment.survey.cameras.size(); ++i) {
    verdict.cameras.push_back(judge_camera(adjustment, static_cast<int>(i), held_out[i]));
  }
  verdict.lengths = check_lengths(adjustment);
  add_warnings(adjustment, verdict);
  return verdict;
}

}  // namespace semblance
