#include "semblance/optim/parameter_space.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <set>

#include "semblance/core/errors.h"
#include "semblance/core/rigid3.h"

namespace semblance {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

Eigen::Quaterniond quaternion_at(const Eigen::VectorXd& x, Eigen::Index offset) {
  return Eigen::Quaterniond(x[offset], x[offset + 1], x[offset + 2], x[offset + 3]).normalized();
}

Eigen::Vector4d wxyz(const Eigen::Quaterniond& q) { return {q.w(), q.x(), q.y(), q.z()}; }

[[noreturn]] void reject(const ParameterBlock& block, const std::string& what) {
  throw InvalidInput("parameter '" + block.name + "': " + what);
}

void check_size(const ParameterBlock& block, const Eigen::VectorXd& values, const char* what) {
  if (values.size() != block.size) {
    reject(block, std::string(what) + " has " + std::to_string(values.size()) +
                      " entries, expected " + std::to_string(block.size));
  }
}

void fill_if_empty(Eigen::VectorXd& values, int size, double value) {
  if (values.size() == 0) values = Eigen::VectorXd::Constant(size, value);
}

void complete_rotation(ParameterBlock& block) {
  if (block.size != 4) reject(block, "a rotation has size 4 (unit quaternion w, x, y, z)");
  block.lower = Eigen::Vector4d::Constant(-1.0);
  block.upper = Eigen::Vector4d::Constant(1.0);
  if (block.prior_mean.size() == 0) block.prior_mean = Eigen::Vector4d(1.0, 0.0, 0.0, 0.0);
  fill_if_empty(block.prior_sigma, 3, infinity);
  check_size(block, block.prior_mean, "the prior mean");
  if (!(std::abs(block.prior_mean.norm() - 1.0) < 1e-6)) {
    reject(block, "the prior mean must be a unit quaternion");
  }
  if (block.prior_sigma.size() != 3) reject(block, "a rotation has three prior sigmas, in radian");
}

void complete_euclidean(ParameterBlock& block) {
  fill_if_empty(block.lower, block.size, -infinity);
  fill_if_empty(block.upper, block.size, infinity);
  check_size(block, block.lower, "the lower bound");
  check_size(block, block.upper, "the upper bound");
  if (!(block.lower.array() <= block.upper.array()).all()) {
    reject(block, "every lower bound must be at most its upper bound");
  }
  if (block.prior_mean.size() == 0) {
    block.prior_mean =
        Eigen::VectorXd::Zero(block.size).cwiseMax(block.lower).cwiseMin(block.upper);
  }
  fill_if_empty(block.prior_sigma, block.size, infinity);
  check_size(block, block.prior_mean, "the prior mean");
  check_size(block, block.prior_sigma, "the prior sigma");
  if (!(block.prior_mean.array() >= block.lower.array()).all() ||
      !(block.prior_mean.array() <= block.upper.array()).all()) {
    reject(block, "the prior mean must lie within the bounds");
  }
}

/// Checks the block and fills in what was left empty.
void complete(ParameterBlock& block) {
  if (block.name.empty()) throw InvalidInput("a parameter has no name");
  if (block.size < 1) reject(block, "the size must be at least 1");
  if (block.manifold == Manifold::rotation) {
    complete_rotation(block);
  } else {
    complete_euclidean(block);
  }
  if (!block.prior_mean.allFinite()) reject(block, "the prior mean must be finite");
  if (!(block.prior_sigma.array() > 0.0).all()) reject(block, "every prior sigma must be positive");
}

void check_vector(const Eigen::VectorXd& values, Eigen::Index expected, const char* what) {
  if (values.size() != expected) {
    throw InvalidInput(std::string(what) + " has " + std::to_string(values.size()) +
                       " entries, the parameter space has " + std::to_string(expected));
  }
}

double euclidean_scale(const ParameterBlock& block, int i) {
  if (std::isfinite(block.prior_sigma[i])) return block.prior_sigma[i];
  const double range = block.upper[i] - block.lower[i];
  return std::isfinite(range) && range > 0.0 ? 0.1 * range : 0.1;
}

}  // namespace

ParameterBlock scalar_block(const std::string& name, const std::string& unit, double lower,
                            double upper, double mean, double sigma, const std::string& doc) {
  ParameterBlock block;
  block.name = name;
  block.unit = unit;
  block.lower = Eigen::VectorXd::Constant(1, lower);
  block.upper = Eigen::VectorXd::Constant(1, upper);
  block.prior_mean = Eigen::VectorXd::Constant(1, mean);
  block.prior_sigma = Eigen::VectorXd::Constant(1, sigma);
  block.doc = doc;
  return block;
}

ParameterBlock rotation_block(const std::string& name, const std::string& doc) {
  ParameterBlock block;
  block.name = name;
  block.size = 4;
  block.manifold = Manifold::rotation;
  block.doc = doc;
  return block;
}

ParameterBlock translation_block(const std::string& name, double limit_m, const std::string& doc) {
  ParameterBlock block;
  block.name = name;
  block.size = 3;
  block.unit = std::string("m");
  block.lower = Eigen::Vector3d::Constant(-limit_m);
  block.upper = Eigen::Vector3d::Constant(limit_m);
  block.doc = doc;
  return block;
}

ParameterSpace::ParameterSpace(std::vector<ParameterBlock> blocks) : blocks_(std::move(blocks)) {
  std::set<std::string> names;
  for (ParameterBlock& block : blocks_) {
    complete(block);
    if (!names.insert(block.name).second) reject(block, "the name is used twice");
    offsets_.push_back(size_);
    tangent_offsets_.push_back(tangent_size_);
    size_ += block.size;
    tangent_size_ += tangent_size(block);
  }
}

int ParameterSpace::block_index(const std::string& name) const {
  std::string known;
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    if (blocks_[i].name == name) return static_cast<int>(i);
    known += (i == 0 ? "" : ", ") + blocks_[i].name;
  }
  throw InvalidInput("no parameter is called '" + name + "'; there are: " + known);
}

Eigen::VectorXd ParameterSpace::initial() const {
  Eigen::VectorXd x(size_);
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    x.segment(offsets_[b], blocks_[b].size) = blocks_[b].prior_mean;
  }
  return x;
}

Eigen::VectorXd ParameterSpace::plus(const Eigen::VectorXd& x, const Eigen::VectorXd& d) const {
  check_vector(x, size_, "a point");
  check_vector(d, tangent_size_, "a step");
  Eigen::VectorXd moved(size_);
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    const ParameterBlock& block = blocks_[b];
    const Eigen::Index at = offsets_[b], tangent_at = tangent_offsets_[b];
    if (block.manifold == Manifold::rotation) {
      const Eigen::Quaterniond turn = quaternion_from_rotation_vector(d.segment<3>(tangent_at));
      moved.segment<4>(at) = wxyz((turn * quaternion_at(x, at)).normalized());
    } else {
      moved.segment(at, block.size) =
          (x.segment(at, block.size) + d.segment(tangent_at, block.size))
              .cwiseMax(block.lower)
              .cwiseMin(block.upper);
    }
  }
  return moved;
}

Eigen::VectorXd ParameterSpace::minus(const Eigen::VectorXd& x, const Eigen::VectorXd& x0) const {
  check_vector(x, size_, "a point");
  check_vector(x0, size_, "a point");
  Eigen::VectorXd d(tangent_size_);
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    const Eigen::Index at = offsets_[b], tangent_at = tangent_offsets_[b];
    if (blocks_[b].manifold == Manifold::rotation) {
      d.segment<3>(tangent_at) =
          rotation_vector_from_quaternion(quaternion_at(x, at) * quaternion_at(x0, at).conjugate());
    } else {
      d.segment(tangent_at, blocks_[b].size) =
          x.segment(at, blocks_[b].size) - x0.segment(at, blocks_[b].size);
    }
  }
  return d;
}

void ParameterSpace::tangent_bounds(const Eigen::VectorXd& x0, Eigen::VectorXd& lower,
                                    Eigen::VectorXd& upper) const {
  check_vector(x0, size_, "a point");
  lower.resize(tangent_size_);
  upper.resize(tangent_size_);
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    const ParameterBlock& block = blocks_[b];
    const Eigen::Index at = offsets_[b], tangent_at = tangent_offsets_[b];
    if (block.manifold == Manifold::rotation) {
      lower.segment<3>(tangent_at).setConstant(-std::numbers::pi);
      upper.segment<3>(tangent_at).setConstant(std::numbers::pi);
    } else {
      lower.segment(tangent_at, block.size) = block.lower - x0.segment(at, block.size);
      upper.segment(tangent_at, block.size) = block.upper - x0.segment(at, block.size);
    }
  }
}

Eigen::VectorXd ParameterSpace::tangent_prior_sigma() const {
  Eigen::VectorXd sigma(tangent_size());
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    sigma.segment(tangent_offsets_[b], tangent_size(blocks_[b])) = blocks_[b].prior_sigma;
  }
  return sigma;
}

Eigen::VectorXd ParameterSpace::tangent_scale() const {
  Eigen::VectorXd scale(tangent_size_);
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    const ParameterBlock& block = blocks_[b];
    for (int i = 0; i < tangent_size(block); ++i) {
      const bool rotation = block.manifold == Manifold::rotation;
      const double sigma = block.prior_sigma[i];
      scale[tangent_offsets_[b] + i] =
          !rotation ? euclidean_scale(block, i) : (std::isfinite(sigma) ? sigma : 0.1);
    }
  }
  return scale;
}

std::vector<std::string> ParameterSpace::entry_names() const {
  std::vector<std::string> names;
  for (const ParameterBlock& block : blocks_) {
    for (int i = 0; i < block.size; ++i) {
      names.push_back(block.size == 1 ? block.name : block.name + "[" + std::to_string(i) + "]");
    }
  }
  return names;
}

std::vector<std::string> ParameterSpace::entry_units() const {
  std::vector<std::string> units;
  for (const ParameterBlock& block : blocks_) units.insert(units.end(), block.size, block.unit);
  return units;
}

}  // namespace semblance
