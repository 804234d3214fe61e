// Model, camera, costs and observation joined into what optimizers minimise.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "semblance/cost/cost.h"
#include "semblance/models/parametric_model.h"

namespace semblance {

/// Buffers for synthesis, kept between objectives of the same model: one set per thread in use.
class SynthesisWorkspace {
 public:
  SynthesisWorkspace(const ParametricModel& model, const SurfaceTopology& topology);
  ~SynthesisWorkspace();

  struct Buffers;
  std::unique_ptr<Buffers> acquire();
  void release(std::unique_ptr<Buffers> buffers);

  const ParametricModel& model() const { return model_; }
  const SurfaceTopology& topology() const { return topology_; }

 private:
  struct Pool;
  const ParametricModel& model_;
  const SurfaceTopology& topology_;
  std::unique_ptr<Pool> pool_;
};

/// Triangles of all objects of the scene that a model makes, numbered through.
SurfaceTopology topology_of(const ParametricModel& model);

/// Sum of costs over the free blocks of a model; the other blocks keep their values in `base`.
class SynthesisObjective : public Objective {
 public:
  SynthesisObjective(SynthesisWorkspace& workspace, Eigen::VectorXd base,
                     const std::vector<int>& free_blocks, const ShLight& light,
                     const Camera& camera, std::vector<const Cost*> costs);

  const ParameterSpace& space() const override { return space_; }
  double evaluate(const Eigen::VectorXd& x) const override;
  bool normal_equations(const Eigen::VectorXd& x, NormalEquations& out) const override;

  /// How far each tangent entry is expected to move: what tangent_scale() of space() returns from
  /// now on. Optimizers take their steps, search radii and tolerances from it.
  void set_step_scale(const Eigen::VectorXd& tangent_sigma);

  /// The free entries of a full parameter vector, and the full vector for free entries.
  Eigen::VectorXd restrict_to_free(const Eigen::VectorXd& full) const;
  Eigen::VectorXd full(const Eigen::VectorXd& x) const;
  /// Tangent entries of the model that are free, in order.
  const std::vector<int>& tangent_columns() const { return tangent_columns_; }

  /// Calls `use` with the synthesis at x.
  void with_synthesis(const Eigen::VectorXd& x,
                      const std::function<void(const Synthesis&)>& use) const;

 private:
  SynthesisWorkspace& workspace_;
  Eigen::VectorXd base_;
  std::vector<int> free_blocks_;
  ParameterSpace space_;
  std::vector<int> tangent_columns_;
  ShLight light_;
  Camera camera_;
  std::vector<const Cost*> costs_;
};

}  // namespace semblance
