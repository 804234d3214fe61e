#include "semblance/optim/optimizer.h"

#include <array>

#include "methods.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

struct Method {
  const char* name;
  std::unique_ptr<Optimizer> (*make)(const OptimizerOptions&);
};

constexpr std::array<Method, 7> methods{{
    {"lm", make_lm},
    {"ceres", make_ceres},
    {"anneal", make_anneal},
    {"interacting", make_interacting},
    {"particle", make_particle},
    {"pso", make_pso},
    {"cmaes", make_cmaes},
}};

}  // namespace

std::vector<std::string> optimizer_names() {
  std::vector<std::string> names;
  for (const Method& method : methods) names.emplace_back(method.name);
  return names;
}

std::unique_ptr<Optimizer> make_optimizer(const std::string& name,
                                          const OptimizerOptions& options) {
  std::string known;
  for (const Method& method : methods) {
    if (name == method.name) return method.make(options);
    known += (known.empty() ? "" : ", ") + std::string(method.name);
  }
  throw InvalidInput("no optimizer is called '" + name + "'; there are: " + known);
}

}  // namespace semblance
