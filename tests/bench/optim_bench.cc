// Cost of the optimizers themselves, and of the whole-clip solve, at the sizes of face tracking.
#include <benchmark/benchmark.h>

#include "semblance/core/random.h"
#include "semblance/optim/optimizer.h"
#include "semblance/pipeline/clip_smoother.h"

namespace semblance {
namespace {

/// Pose and `extra` bounded parameters with standard deviation one.
ParameterSpace face_like_space(int extra) {
  ParameterBlock block;
  block.name = "shape";
  block.size = extra;
  block.lower = Eigen::VectorXd::Constant(extra, -3.0);
  block.upper = Eigen::VectorXd::Constant(extra, 3.0);
  block.prior_sigma = Eigen::VectorXd::Ones(extra);
  return ParameterSpace({block, rotation_block("rotation", ""), translation_block("t", 5.0, "")});
}

Eigen::MatrixXd random_matrix(Random& random, Eigen::Index rows, Eigen::Index columns) {
  Eigen::MatrixXd a(rows, columns);
  for (Eigen::Index j = 0; j < columns; ++j) a.col(j) = random.normal_vector(rows);
  return a;
}

/// A nearly free quadratic, so that what is measured is the optimizer.
class Quadratic final : public Objective {
 public:
  explicit Quadratic(int extra) : space_(face_like_space(extra)) {
    Random random(1);
    const Eigen::Index n = space_.tangent_size();
    const Eigen::MatrixXd a = random_matrix(random, 2 * n, n);
    hessian_ = a.transpose() * a / static_cast<double>(n);
    best_ = space_.plus(space_.initial(),
                        0.3 * space_.tangent_scale().cwiseProduct(random.normal_vector(n)));
  }
  const ParameterSpace& space() const override { return space_; }
  double evaluate(const Eigen::VectorXd& x) const override {
    const Eigen::VectorXd d = space_.minus(x, best_);
    return 1.0 + 0.5 * d.dot(hessian_ * d);
  }
  bool normal_equations(const Eigen::VectorXd& x, NormalEquations& out) const override {
    const Eigen::VectorXd d = space_.minus(x, best_);
    out.hessian = hessian_;
    out.gradient = hessian_ * d;
    out.cost = 1.0 + 0.5 * d.dot(out.gradient);
    return true;
  }

 private:
  ParameterSpace space_;
  Eigen::MatrixXd hessian_;
  Eigen::VectorXd best_;
};

void optimizer_overhead(benchmark::State& state, const char* name) {
  const Quadratic objective(static_cast<int>(state.range(0)) - 6);
  OptimizerOptions options;
  options.max_evaluations = 2000;
  const auto optimizer = make_optimizer(name, options);
  Solution solution;
  for (auto _ : state) {
    solution = optimizer->minimize(objective, objective.space().initial(), silent_progress());
  }
  state.counters["evaluations"] = static_cast<double>(solution.evaluations);
  state.counters["excess_cost"] = solution.cost - 1.0;
}
BENCHMARK_CAPTURE(optimizer_overhead, lm, "lm")->Arg(12)->Arg(45)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(optimizer_overhead, ceres, "ceres")
    ->Arg(12)
    ->Arg(45)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(optimizer_overhead, anneal, "anneal")->Arg(12)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(optimizer_overhead, interacting, "interacting")
    ->Arg(12)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(optimizer_overhead, particle, "particle")->Arg(12)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(optimizer_overhead, pso, "pso")->Arg(12)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(optimizer_overhead, cmaes, "cmaes")->Arg(12)->Unit(benchmark::kMillisecond);

/// 45 parameters, the first 20 of them shared by all frames.
void clip_smoother(benchmark::State& state) {
  std::vector<ParameterBlock> blocks = face_like_space(39).blocks();
  ParameterBlock identity = blocks[0];
  identity.name = "identity";
  identity.size = 20;
  blocks[0].size = 19;
  for (ParameterBlock* block : {&identity, &blocks[0]}) {
    for (Eigen::VectorXd* values :
         {&block->lower, &block->upper, &block->prior_mean, &block->prior_sigma}) {
      values->conservativeResize(block->size);
    }
  }
  blocks.insert(blocks.begin(), identity);
  const ParameterSpace space(blocks);
  const Eigen::Index n = space.tangent_size();
  Random random(1);
  std::vector<ClipFrame> frames(static_cast<std::size_t>(state.range(0)));
  for (ClipFrame& frame : frames) {
    const Eigen::MatrixXd J = 10.0 * random_matrix(random, 2 * n, n);
    const Eigen::VectorXd r = random.normal_vector(2 * n);
    frame.x = space.plus(space.initial(), 0.1 * random.normal_vector(n));
    frame.model = NormalEquations{J.transpose() * J, J.transpose() * r, 0.5 * r.squaredNorm()};
  }
  ClipSmootherOptions options;
  options.acceleration_sigma = Eigen::VectorXd::Constant(n, 0.05);
  options.shared_blocks = {0};
  for (auto _ : state) {
    const SmoothedClip clip = smooth_clip(space, frames, options, silent_progress());
    if (!clip.converged) state.SkipWithError("did not converge");
  }
  state.counters["frames/s"] = benchmark::Counter(static_cast<double>(state.range(0)),
                                                  benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(clip_smoother)->ArgName("frames")->Arg(300)->Arg(1500)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace semblance
