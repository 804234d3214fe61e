#include "outline_comparison.h"

#include <algorithm>
#include <utility>

namespace semblance {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kOffset_px = 0.25;
constexpr float kStep_px = 0.125f;  // of differences

std::vector<ContourTarget> moved_by(std::vector<ContourTarget> targets, float offset_px) {
  for (ContourTarget& target : targets) target.target_px += offset_px * target.normal;
  return targets;
}

NormalEquations equations_of(const ObjectObjective& objective, const VectorXd& x,
                             std::size_t picture, const Synthesis& synthesis,
                             const ContourCost& cost) {
  NormalEquations out;
  out.reset(static_cast<Eigen::Index>(objective.columns(picture).size()));
  objective.add_cost(x, picture, synthesis, cost, out);
  return out;
}

}  // namespace

OutlineComparison::Moved::Moved(const std::vector<ContourTarget>& targets,
                                const SurfaceTopology& topology)
    : in(moved_by(targets, -kStep_px), &topology),
      found(targets, &topology),
      out(moved_by(targets, kStep_px), &topology) {}

OutlineComparison::OutlineComparison(std::vector<ContourTarget> targets,
                                     const SurfaceTopology& topology)
    : targets_(std::move(targets)), topology_(topology), all_(targets_, topology) {}

OutlineComparison::Slope OutlineComparison::slope(const Moved& moved, const Synthesis& synthesis) {
  const double in = moved.in.evaluate(synthesis, nullptr, nullptr),
               found = moved.found.evaluate(synthesis, nullptr, nullptr),
               out = moved.out.evaluate(synthesis, nullptr, nullptr);
  return {found, (out - in) / (2.0 * kStep_px),
          std::max(0.0, (out - 2.0 * found + in) / (kStep_px * kStep_px))};
}

double OutlineComparison::cost(const Synthesis& synthesis) const {
  const Slope by = slope(all_, synthesis);
  const double curvature = by.curvature + 1.0 / (kOffset_px * kOffset_px);
  return std::max(0.0, by.cost - 0.5 * by.gradient * by.gradient / curvature);
}

void OutlineComparison::add(const ObjectObjective& objective, const VectorXd& x,
                            std::size_t picture, const Synthesis& synthesis,
                            NormalEquations& out) const {
  const Slope by = slope(all_, synthesis);
  const double curvature = by.curvature + 1.0 / (kOffset_px * kOffset_px);
  const auto of = [&](const ContourCost& cost) {
    return equations_of(objective, x, picture, synthesis, cost);
  };
  const NormalEquations found = of(all_.found);
  const VectorXd mixed = (of(all_.out).gradient - of(all_.in).gradient) / (2.0 * kStep_px);
  out.cost += std::max(0.0, found.cost - 0.5 * by.gradient * by.gradient / curvature);
  out.gradient += found.gradient - mixed * (by.gradient / curvature);
  out.hessian += found.hessian - mixed * mixed.transpose() / curvature;
}

MatrixXd OutlineComparison::scores(const ObjectObjective& objective, const VectorXd& x,
                                   std::size_t picture, const Synthesis& synthesis,
                                   const std::vector<std::size_t>& group,
                                   std::size_t groups) const {
  const auto gradient = [&](const ContourCost& cost) -> VectorXd {
    return equations_of(objective, x, picture, synthesis, cost).gradient;
  };
  const double curvature = slope(all_, synthesis).curvature + 1.0 / (kOffset_px * kOffset_px);
  const VectorXd mixed = (gradient(all_.out) - gradient(all_.in)) / (2.0 * kStep_px);
  MatrixXd out = MatrixXd::Zero(mixed.size(), static_cast<Eigen::Index>(groups) + 1);
  for (std::size_t k = 0; k < groups; ++k) {
    std::vector<ContourTarget> part;
    for (std::size_t i = 0; i < targets_.size(); ++i) {
      if (group[i] == k) part.push_back(targets_[i]);
    }
    if (part.empty()) continue;
    const Moved moved(part, topology_);
    out.col(static_cast<Eigen::Index>(k)) =
        gradient(moved.found) - mixed * (slope(moved, synthesis).gradient / curvature);
  }
  // The offset's own deviation, less what the edges say of it.
  out.rightCols<1>() = mixed * (1.0 / (kOffset_px * curvature));
  return out;
}

}  // namespace semblance
