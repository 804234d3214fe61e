// What contacts do to a sheet: a barrier along normals, anchored friction across them.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "semblance/cloth/block_matrix.h"
#include "semblance/cloth/contact.h"

namespace semblance {

/// How contacts answer.
struct ContactLaw {
  double barrier_pa = 20.0;  // p0: the pressure at about half of the reach
  double friction = 0.3;
  /// Friction is a spring across the contact that slips when it pulls with friction times the
  /// normal force; it then is stretched by this length. Cloth on it settles instead of chattering
  /// or creeping.
  double slip_m = 5e-5;
};

/// Stretch of each friction spring, by the key of its contact.
using FrictionMemory = std::unordered_map<std::uint64_t, Eigen::Vector3d>;

/// Friction over one step, with normals, normal forces and weights of its start (lagged, as in Li
/// et al. 2020, section 5), so that it has a potential.
class FrictionStep {
 public:
  FrictionStep() = default;
  FrictionStep(const std::vector<Contact>& contacts, const Points& positions_m, double step_s,
               const ContactLaw& law, const FrictionMemory& memory);

  double energy(const Points& positions_m) const;
  /// Energy; adds to `gradient`, and to `matrix` where it is given.
  double add_gradient(const Points& positions_m, Points& gradient, BlockMatrix* matrix) const;
  /// The springs' stretch at the end of the step.
  FrictionMemory memory(const Points& positions_m) const;

 private:
  struct Spring {
    std::uint64_t key;
    std::array<int, 4> vertex;
    std::array<double, 4> weight;
    Eigen::Vector3d normal;
    Eigen::Vector3d origin_m;  // stretch = across the normal, sum of weights * x - origin
    double limit_n;            // friction times normal force
  };
  Eigen::Vector3d stretch(const Spring& spring, const Points& positions_m) const;

  std::vector<Spring> springs_;
  double slip_m_ = 1.0;
};

/// Energy of the barriers; adds to `gradient` and `matrix` where they are given.
double add_barriers(const std::vector<Contact>& contacts, const ContactLaw& law, Points* gradient,
                    BlockMatrix* matrix);

}  // namespace semblance
