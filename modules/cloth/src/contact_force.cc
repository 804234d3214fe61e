#include "semblance/cloth/contact_force.h"

#include <algorithm>
#include <cmath>

#include "semblance/cloth/barrier.h"

namespace semblance {
namespace {

Eigen::Vector3d relative(const std::array<int, 4>& vertex, const std::array<double, 4>& weight,
                         const Points& positions_m) {
  Eigen::Vector3d r = Eigen::Vector3d::Zero();
  for (int i = 0; i < 4 && vertex[i] >= 0; ++i) {
    r += weight[i] * positions_m.row(vertex[i]).transpose();
  }
  return r;
}

void add_force(const std::array<int, 4>& vertex, const std::array<double, 4>& weight,
               const Eigen::Vector3d& slope, Points& gradient) {
  for (int i = 0; i < 4 && vertex[i] >= 0; ++i) gradient.row(vertex[i]) += weight[i] * slope;
}

}  // namespace

double add_barriers(const std::vector<Contact>& contacts, const ContactLaw& law, Points* gradient,
                    BlockMatrix* matrix) {
  double energy = 0.0;
  for (const Contact& contact : contacts) {
    const BarrierValue value = barrier(contact.gap_m, contact.reach_m, law.barrier_pa);
    energy += contact.area_m2 * value.energy_j_m2;
    if (gradient == nullptr) continue;
    add_force(contact.vertex, contact.weight, -contact.area_m2 * value.pressure_pa * contact.normal,
              *gradient);
    if (matrix == nullptr) continue;
    matrix->add(
        contact.vertex, contact.weight,
        contact.area_m2 * value.stiffness_pa_m * contact.normal * contact.normal.transpose());
  }
  return energy;
}

FrictionStep::FrictionStep(const std::vector<Contact>& contacts, const Points& positions_m,
                           double step_s, const ContactLaw& law, const FrictionMemory& memory)
    : slip_m_(law.slip_m) {
  if (law.friction <= 0.0) return;
  springs_.reserve(contacts.size());
  for (const Contact& contact : contacts) {
    const double force =
        contact.area_m2 * barrier(contact.gap_m, contact.reach_m, law.barrier_pa).pressure_pa;
    Eigen::Vector3d stretched = Eigen::Vector3d::Zero();
    const auto found = memory.find(contact.key);
    if (found != memory.end()) stretched = found->second;
    stretched -= contact.normal.dot(stretched) * contact.normal;
    Eigen::Vector3d origin = relative(contact.vertex, contact.weight, positions_m) - stretched;
    if (std::isfinite(step_s)) origin += step_s * contact.obstacle_velocity_m_s;
    springs_.push_back({contact.key, contact.vertex, contact.weight, contact.normal, origin,
                        law.friction * force});
  }
}

Eigen::Vector3d FrictionStep::stretch(const Spring& spring, const Points& positions_m) const {
  const Eigen::Vector3d r = relative(spring.vertex, spring.weight, positions_m) - spring.origin_m;
  return r - spring.normal.dot(r) * spring.normal;
}

double FrictionStep::energy(const Points& positions_m) const {
  double energy = 0.0;
  for (const Spring& spring : springs_) {
    const double length = stretch(spring, positions_m).norm();
    energy += spring.limit_n *
              (length <= slip_m_ ? 0.5 * length * length / slip_m_ : length - 0.5 * slip_m_);
  }
  return energy;
}

double FrictionStep::add_gradient(const Points& positions_m, Points& gradient,
                                  BlockMatrix* matrix) const {
  double energy = 0.0;
  for (const Spring& spring : springs_) {
    const Eigen::Vector3d s = stretch(spring, positions_m);
    const double length = s.norm();
    const bool slips = length > slip_m_;
    const double per_length = spring.limit_n / (slips ? length : slip_m_);
    energy += spring.limit_n * (slips ? length - 0.5 * slip_m_ : 0.5 * length * length / slip_m_);
    add_force(spring.vertex, spring.weight, per_length * s, gradient);
    if (matrix == nullptr) continue;
    Eigen::Matrix3d k =
        per_length * (Eigen::Matrix3d::Identity() - spring.normal * spring.normal.transpose());
    if (slips) k -= per_length / (length * length) * s * s.transpose();
    matrix->add(spring.vertex, spring.weight, k);
  }
  return energy;
}

FrictionMemory FrictionStep::memory(const Points& positions_m) const {
  FrictionMemory memory;
  memory.reserve(springs_.size());
  for (const Spring& spring : springs_) {
    Eigen::Vector3d s = stretch(spring, positions_m);
    const double length = s.norm();
    if (length > slip_m_) s *= slip_m_ / length;
    memory.emplace(spring.key, s);
  }
  return memory;
}

}  // namespace semblance
