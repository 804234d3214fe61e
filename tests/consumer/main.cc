// Uses several modules as another project would: fits the built-in face back to its own prior,
// draws it, and reads back points that it wrote.
#include <semblance/core/camera.h>
#include <semblance/core/version.h>
#include <semblance/cost/prior.h>
#include <semblance/io/points.h>
#include <semblance/models/face.h>
#include <semblance/optim/optimizer.h>
#include <semblance/pipeline/synthesis_objective.h>
#include <semblance/render/renderer.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <vector>

namespace {

int failures = 0;

void check(bool holds, const char* what) {
  std::printf("%s: %s\n", what, holds ? "holds" : "FAILS");
  if (!holds) ++failures;
}

}  // namespace

int main() {
  using namespace semblance;
  std::printf("%s\n", program_version());
  Camera camera = Camera::centred(640, 480, 500.0);
  const Eigen::Vector2d pixel = project_world(camera, {0.5, 0.5, -2.5});
  check((pixel - Eigen::Vector2d(420.0, 140.0)).norm() < 1e-9, "a cube's corner in the picture");

  camera.camera_from_world.translation_m.z() += 0.6;

  // The prior's minimum is its mean, so the optimizer must come back to it from elsewhere.
  const MorphModel model(make_sweep_face());
  const Eigen::VectorXd rest = model.parameters().initial();
  const std::vector<ParameterBlock>& blocks = model.parameters().blocks();
  std::vector<int> shape_blocks(blocks.size() - MorphModel::first_shape_block);
  std::iota(shape_blocks.begin(), shape_blocks.end(), MorphModel::first_shape_block);
  const ParameterSpace space({blocks.begin() + MorphModel::first_shape_block, blocks.end()});
  const PriorCost prior(space);
  const SurfaceTopology topology = topology_of(model);
  SynthesisWorkspace workspace(model, topology);
  const SynthesisObjective objective(workspace, rest, shape_blocks, ShLight(), camera, {&prior});
  const Eigen::VectorXd mean = space.initial();
  const Eigen::VectorXd away = space.plus(mean, 0.1 * space.tangent_scale());
  const Solution solution = make_optimizer("lm", {})->minimize(objective, away, silent_progress());
  check(solution.termination == Termination::converged && (solution.x - mean).norm() < 1e-3,
        "the face back at its prior");

  Scene scene;
  model.synthesize(rest, scene);
  const Frame frame = make_renderer("raster")->render(scene, camera, Channel::mask);
  check(std::count(frame.mask.begin(), frame.mask.end(), 1) > 100, "the face in the picture");

  write_points("points.json", {pixel});
  check(read_points("points.json").at(0) == pixel, "points written and read");
  return failures;
}
