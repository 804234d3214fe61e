// Makers of the optimizers, for the table in optimizer.cc.
#pragma once

#include <memory>

#include "semblance/optim/optimizer.h"

namespace semblance {

std::unique_ptr<Optimizer> make_lm(const OptimizerOptions& options);
std::unique_ptr<Optimizer> make_ceres(const OptimizerOptions& options);
std::unique_ptr<Optimizer> make_anneal(const OptimizerOptions& options);
std::unique_ptr<Optimizer> make_interacting(const OptimizerOptions& options);
std::unique_ptr<Optimizer> make_particle(const OptimizerOptions& options);
std::unique_ptr<Optimizer> make_pso(const OptimizerOptions& options);
std::unique_ptr<Optimizer> make_cmaes(const OptimizerOptions& options);

}  // namespace semblance
