// The face tracker's two inner loops: one comparison of the synthetic face with an image, and one
// Gauss-Newton step. The built-in face shows about 200 x 200 pixels; its identity is fixed, and
// pose and all expression parameters change from one evaluation to the next.
#include <benchmark/benchmark.h>

#include <Eigen/Cholesky>
#include <chrono>
#include <cmath>
#include <cstdlib>

#include "semblance/core/parallel.h"
#include "semblance/core/random.h"
#include "semblance/cost/photometric.h"
#include "semblance/models/face.h"
#include "semblance/pipeline/synthesis_objective.h"
#include "semblance/render/renderer.h"

namespace semblance {
namespace {

MorphShape person() {
  const MorphShape shape = make_sweep_face();
  Random random(1);
  Eigen::VectorXd identity(shape.identity_count);
  for (int i = 0; i < identity.size(); ++i) identity[i] = random.uniform(-0.5, 0.5);
  return with_identity(shape, identity);
}

/// A photograph-like picture of the face at one place, and an objective that compares with it.
struct FaceFit {
  MorphModel model{person()};
  SurfaceTopology topology = topology_of(model);
  SynthesisWorkspace workspace{model, topology};
  Camera camera = Camera::centred(320, 320, 700.0);
  Eigen::VectorXd base = model.parameters().initial();
  std::vector<int> free_blocks;
  std::vector<float> triangle_weight;
  Observation observation;
  std::unique_ptr<Appearance> appearance;
  std::unique_ptr<PhotometricCost> cost;
  std::unique_ptr<SynthesisObjective> objective;
  std::vector<Eigen::VectorXd> places;  // moved by about a pixel, with another expression each
  std::size_t visible = 0;

  FaceFit();
};

FaceFit::FaceFit() {
  const ParameterSpace& space = model.parameters();
  base[space.offset(space.block_index("translation")) + 2] = -0.62;
  for (std::size_t b = 0; b < space.blocks().size(); ++b) {
    free_blocks.push_back(static_cast<int>(b));
  }
  triangle_weight.assign(topology.triangles.size(), 1.0f);
  Scene scene;
  model.synthesize(base, scene);
  const Mesh& mesh = *model.shape().mesh;
  PointsF colour(mesh.vertex_count(), 3);
  for (Eigen::Index v = 0; v < colour.rows(); ++v) {
    const Eigen::Vector3d p = 300.0 * mesh.positions_m.row(v);
    colour.row(v) << 0.6 + 0.1 * std::sin(p.x()), 0.45 + 0.1 * std::sin(p.y()), 0.4;
  }
  appearance = std::make_unique<Appearance>(
      mesh, 512, colour, std::vector<float>(static_cast<std::size_t>(mesh.vertex_count()), 0.5f));
  scene.objects[0].material.texture = std::make_shared<Image>(appearance->texture());
  observation =
      make_observation(make_renderer("raster")->render(scene, camera, Channel::colour).colour, 1);
  PhotometricOptions options;
  options.texture_level = 1;
  cost = std::make_unique<PhotometricCost>(&observation.levels[0], appearance.get(), &topology,
                                           &triangle_weight, options);
  objective = std::make_unique<SynthesisObjective>(workspace, base, free_blocks, ShLight(), camera,
                                                   std::vector<const Cost*>{cost.get()});
  objective->with_synthesis(base, [&](const Synthesis& synthesis) {
    visible = synthesis.pixels.size();
    const int level = matching_texture_level(synthesis, *appearance, topology);
    if (level != options.texture_level) std::abort();
  });
  Random random(2);
  for (int i = 0; i < 64; ++i) {
    Eigen::VectorXd step(space.tangent_size());
    for (Eigen::Index k = 0; k < step.size(); ++k) {
      step[k] = random.uniform(-1.0, 1.0) * (k < 3 ? 0.01 : k < 6 ? 0.001 : 0.2);
    }
    places.push_back(space.plus(base, step));
  }
}

FaceFit& fit() {
  static FaceFit shared;
  return shared;
}

void report(benchmark::State& state) {
  state.counters["pixels"] = static_cast<double>(fit().visible);
  state.counters["triangles"] = static_cast<double>(fit().topology.triangles.size());
  state.counters["parameters"] = static_cast<double>(fit().objective->space().tangent_size());
}

/// Time and rate are those of one evaluation by the clock on the wall, in batches as optimizers
/// make.
void photometric_evaluation(benchmark::State& state, int threads) {
  const FaceFit& face = fit();
  set_thread_count(threads);
  std::vector<double> costs(face.places.size());
  const auto batch = static_cast<benchmark::IterationCount>(costs.size());
  const auto start = std::chrono::steady_clock::now();
  while (state.KeepRunningBatch(batch)) {
    face.objective->evaluate_batch(face.places, costs);
    benchmark::DoNotOptimize(costs.data());
  }
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  set_thread_count(0);
  report(state);
  state.counters["items_per_second"] = static_cast<double>(state.iterations()) / elapsed.count();
}

/// Normal equations and their damped solution, as Levenberg-Marquardt takes it.
void gauss_newton_step(benchmark::State& state) {
  const FaceFit& face = fit();
  NormalEquations equations;
  Eigen::VectorXd step;
  std::size_t next = 0;
  for (auto _ : state) {
    face.objective->normal_equations(face.places[next++ % face.places.size()], equations);
    equations.hessian.diagonal() *= 1.001;
    step = equations.hessian.ldlt().solve(-equations.gradient);
    benchmark::DoNotOptimize(step.data());
  }
  report(state);
}

BENCHMARK_CAPTURE(photometric_evaluation, one, 1)
    ->Name("photometric_evaluation/face/threads:1")
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(photometric_evaluation, two, 2)
    ->Name("photometric_evaluation/face/threads:2")
    ->Unit(benchmark::kMicrosecond);
BENCHMARK(gauss_newton_step)->Name("gauss_newton_step/face")->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace semblance
