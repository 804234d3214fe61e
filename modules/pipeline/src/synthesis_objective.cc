#include "semblance/pipeline/synthesis_objective.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>

namespace semblance {

struct SynthesisWorkspace::Buffers {
  explicit Buffers(const SurfaceTopology* topology) : equations(topology) {}
  Scene scene;
  // What is seen from behind through a hole of the surface has no colour to compare.
  Rasteriser rasteriser{Rasteriser::Instructions::best, Rasteriser::Faces::front};
  VisiblePixels pixels;
  SurfaceEquations equations;
  std::vector<ImageFromWorld> image_from_world;
  SurfaceEquations::Motion motion;

  /// Fills `image_from_world` for the listed vertices.
  void linearize_projection(const Camera& camera, std::span<const float> projected,
                            const std::vector<int>& vertices);
};

void SynthesisWorkspace::Buffers::linearize_projection(const Camera& camera,
                                                       std::span<const float> projected,
                                                       const std::vector<int>& vertices) {
  const Eigen::Matrix3f rotation =
      camera.camera_from_world.rotation.toRotationMatrix().cast<float>();
  const Eigen::Vector2f focal = camera.focal_px.cast<float>();
  const Eigen::Vector2f principal = camera.principal_px.cast<float>();
  image_from_world.resize(vertices.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const float* p = projected.data() + 3 * std::ptrdiff_t{vertices[i]};
    for (int axis = 0; axis < 2; ++axis) {
      // Pixel = f X/Z + c, so d(pixel) = (f dX - (pixel - c) dZ) / Z.
      image_from_world[i].row(axis) =
          (focal[axis] * rotation.row(axis) - (p[axis] - principal[axis]) * rotation.row(2)) / p[2];
    }
  }
}

struct SynthesisWorkspace::Pool {
  std::mutex mutex;
  std::vector<std::unique_ptr<Buffers>> idle;
};

SynthesisWorkspace::SynthesisWorkspace(const ParametricModel& model,
                                       const SurfaceTopology& topology)
    : model_(model), topology_(topology), pool_(std::make_unique<Pool>()) {}

SynthesisWorkspace::~SynthesisWorkspace() = default;

std::unique_ptr<SynthesisWorkspace::Buffers> SynthesisWorkspace::acquire() {
  const std::lock_guard lock(pool_->mutex);
  if (pool_->idle.empty()) return std::make_unique<Buffers>(&topology_);
  std::unique_ptr<Buffers> buffers = std::move(pool_->idle.back());
  pool_->idle.pop_back();
  return buffers;
}

void SynthesisWorkspace::release(std::unique_ptr<Buffers> buffers) {
  const std::lock_guard lock(pool_->mutex);
  pool_->idle.push_back(std::move(buffers));
}

SurfaceTopology topology_of(const ParametricModel& model) {
  Scene scene;
  model.synthesize(model.parameters().initial(), scene);
  Eigen::Index count = 0;
  for (const SceneObject& object : scene.objects) count += object.mesh->triangle_count();
  SurfaceTopology::Triangles triangles(count, 3);
  Eigen::Index row = 0;
  int first_vertex = 0;
  for (const SceneObject& object : scene.objects) {
    triangles.middleRows(row, object.mesh->triangle_count()) =
        object.mesh->triangles.array() + first_vertex;
    row += object.mesh->triangle_count();
    first_vertex += static_cast<int>(object.mesh->vertex_count());
  }
  return SurfaceTopology(triangles);
}

namespace {

ParameterSpace subspace(const ParameterSpace& space, const std::vector<int>& blocks) {
  std::vector<ParameterBlock> kept;
  for (int b : blocks) kept.push_back(space.blocks()[static_cast<std::size_t>(b)]);
  return ParameterSpace(std::move(kept));
}

/// Lends buffers for a scope.
class Lease {
 public:
  explicit Lease(SynthesisWorkspace& workspace)
      : workspace_(workspace), buffers_(workspace.acquire()) {}
  ~Lease() { workspace_.release(std::move(buffers_)); }
  Lease(const Lease&) = delete;
  SynthesisWorkspace::Buffers* operator->() { return buffers_.get(); }

 private:
  SynthesisWorkspace& workspace_;
  std::unique_ptr<SynthesisWorkspace::Buffers> buffers_;
};

}  // namespace

SynthesisObjective::SynthesisObjective(SynthesisWorkspace& workspace, Eigen::VectorXd base,
                                       const std::vector<int>& free_blocks, const ShLight& light,
                                       const Camera& camera, std::vector<const Cost*> costs)
    : workspace_(workspace),
      base_(std::move(base)),
      free_blocks_(free_blocks),
      space_(subspace(workspace.model().parameters(), free_blocks)),
      light_(light),
      camera_(camera),
      costs_(std::move(costs)) {
  const ParameterSpace& all = workspace_.model().parameters();
  for (int b : free_blocks_) {
    const int size = ParameterSpace::tangent_size(all.blocks()[static_cast<std::size_t>(b)]);
    for (int k = 0; k < size; ++k) {
      tangent_columns_.push_back(static_cast<int>(all.tangent_offset(b)) + k);
    }
  }
}

void SynthesisObjective::set_step_scale(const Eigen::VectorXd& tangent_sigma) {
  std::vector<ParameterBlock> blocks = space_.blocks();
  Eigen::Index entry = 0;
  for (ParameterBlock& block : blocks) {
    const int size = ParameterSpace::tangent_size(block);
    block.prior_sigma = tangent_sigma.segment(entry, size);
    entry += size;
  }
  space_ = ParameterSpace(std::move(blocks));
}

Eigen::VectorXd SynthesisObjective::restrict_to_free(const Eigen::VectorXd& whole) const {
  const ParameterSpace& all = workspace_.model().parameters();
  Eigen::VectorXd out(space_.size());
  for (std::size_t i = 0; i < free_blocks_.size(); ++i) {
    const int size = space_.blocks()[i].size;
    out.segment(space_.offset(static_cast<int>(i)), size) =
        whole.segment(all.offset(free_blocks_[i]), size);
  }
  return out;
}

Eigen::VectorXd SynthesisObjective::full(const Eigen::VectorXd& x) const {
  const ParameterSpace& all = workspace_.model().parameters();
  Eigen::VectorXd out = base_;
  for (std::size_t i = 0; i < free_blocks_.size(); ++i) {
    const int size = space_.blocks()[i].size;
    out.segment(all.offset(free_blocks_[i]), size) =
        x.segment(space_.offset(static_cast<int>(i)), size);
  }
  return out;
}

void SynthesisObjective::with_synthesis(const Eigen::VectorXd& x,
                                        const std::function<void(const Synthesis&)>& use) const {
  Lease buffers(workspace_);
  workspace_.model().synthesize(full(x), buffers->scene);
  buffers->scene.light = light_;
  buffers->rasteriser.visible_pixels(buffers->scene, camera_, nullptr, buffers->pixels);
  use({space_, x, buffers->scene, camera_, buffers->pixels,
       buffers->rasteriser.projected_vertices()});
}

double SynthesisObjective::evaluate(const Eigen::VectorXd& x) const {
  double total = 0.0;
  with_synthesis(x, [&](const Synthesis& synthesis) {
    for (const Cost* cost : costs_) total += cost->evaluate(synthesis, nullptr, nullptr);
  });
  return std::isfinite(total) ? total : std::numeric_limits<double>::infinity();
}

bool SynthesisObjective::normal_equations(const Eigen::VectorXd& x, NormalEquations& out) const {
  out.reset(space_.tangent_size());
  Lease buffers(workspace_);
  const Eigen::VectorXd whole = full(x);
  workspace_.model().synthesize(whole, buffers->scene);
  buffers->scene.light = light_;
  buffers->rasteriser.visible_pixels(buffers->scene, camera_, nullptr, buffers->pixels);
  const std::span<const float> projected = buffers->rasteriser.projected_vertices();
  const Synthesis synthesis{space_, x, buffers->scene, camera_, buffers->pixels, projected};
  buffers->equations.reset();
  for (const Cost* cost : costs_) {
    out.cost += cost->evaluate(synthesis, &buffers->equations, &out);
  }
  if (!std::isfinite(out.cost)) return false;

  const std::vector<int>& vertices = buffers->equations.touched_vertices();
  buffers->linearize_projection(camera_, projected, vertices);
  buffers->motion.resize(2 * static_cast<Eigen::Index>(vertices.size()),
                         SurfaceEquations::padded_columns(out.gradient.size()));
  if (!workspace_.model().image_jacobian(whole, tangent_columns_, vertices,
                                         buffers->image_from_world, buffers->motion)) {
    return Objective::normal_equations(x, out);
  }
  buffers->equations.assemble(buffers->motion, out);
  return true;
}

}  // namespace semblance
