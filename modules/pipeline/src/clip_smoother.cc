#include "semblance/pipeline/clip_smoother.h"

#include <ceres/ceres.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>

#include "clip_covariance.h"
#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"
#include "semblance/core/rigid3.h"

namespace semblance {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Standard deviation, in units of tangent_scale(), of what nothing else determines.
constexpr double undetermined_scales = 1000.0;

// ---- Rotations -------------------------------------------------------------------------------

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& w) {
  Eigen::Matrix3d m;
  m << 0.0, -w.z(), w.y(), w.z(), 0.0, -w.x(), -w.y(), w.x(), 0.0;
  return m;
}

/// J with exp(w + e) = exp(J e) exp(w) to first order (Barfoot 2017, equation 7.77).
Eigen::Matrix3d left_jacobian(const Eigen::Vector3d& w) {
  const double angle2 = w.squaredNorm(), angle = std::sqrt(angle2);
  const double a = angle < 1e-4 ? 0.5 - angle2 / 24.0 : (1.0 - std::cos(angle)) / angle2;
  const double b =
      angle < 1e-4 ? 1.0 / 6.0 - angle2 / 120.0 : (angle - std::sin(angle)) / (angle2 * angle);
  const Eigen::Matrix3d m = cross_matrix(w);
  return Eigen::Matrix3d::Identity() + a * m + b * m * m;
}

/// Its inverse (Barfoot 2017, equation 7.76).
Eigen::Matrix3d left_jacobian_inverse(const Eigen::Vector3d& w) {
  const double angle2 = w.squaredNorm(), angle = std::sqrt(angle2);
  const double c = angle < 1e-4 ? 1.0 / 12.0 + angle2 / 720.0
                                : 1.0 / angle2 - 0.5 / (angle * std::tan(0.5 * angle));
  const Eigen::Matrix3d m = cross_matrix(w);
  return Eigen::Matrix3d::Identity() - 0.5 * m + c * m * m;
}

/// The rotation vector from one frame to the next, and its derivatives by both moves.
struct RotationStep {
  Eigen::Vector3d vector;
  Eigen::Matrix3d by_first, by_second;

  RotationStep(const Eigen::Quaterniond& first, const Eigen::Vector3d& d_first,
               const Eigen::Quaterniond& second, const Eigen::Vector3d& d_second) {
    const Eigen::Quaterniond a = quaternion_from_rotation_vector(d_first) * first;
    const Eigen::Quaterniond b = quaternion_from_rotation_vector(d_second) * second;
    vector = rotation_vector_from_quaternion(b * a.conjugate());
    by_first = -left_jacobian_inverse(-vector) * left_jacobian(d_first);
    by_second = left_jacobian_inverse(vector) * left_jacobian(d_second);
  }
};

// ---- The problem -----------------------------------------------------------------------------

/// A frame that takes part. `d` and the clip's `shared` are the unknowns, 0 at the start.
struct Node {
  std::size_t frame = 0;
  bool bridged = false;
  Vector x;               // linearisation point, with the clip's shared values
  Matrix root;            // root'root is the Hessian of the data term, all tangent entries
  Vector offset;          // root * d + offset are its residuals
  double constant = 0.0;  // cost of the data term that no move removes
  Vector d;               // moves of the entries of its own
  int chain = 0;
};

struct Clip {
  explicit Clip(const ParameterSpace& parameters) : space(parameters) {}

  const ParameterSpace& space;
  std::vector<Eigen::Index> own, shared;  // tangent entries
  std::vector<Eigen::Index> rotations;    // first entry of each rotation, as an index into `own`
  std::vector<Eigen::Index> rotation_offsets;              // the same in x
  std::vector<Eigen::Index> euclidean, euclidean_offsets;  // likewise
  Vector weight;  // 1 / acceleration_sigma of the own entries
  std::vector<Node> nodes;
  Vector d_shared;
  // Entries that rest on a bound, own ones node by node, and do not move at present.
  std::vector<std::vector<char>> held;
  std::vector<char> held_shared;

  bool triple(std::size_t k) const {
    return k + 2 < nodes.size() && nodes[k].chain == nodes[k + 2].chain;
  }
};

Vector all_entries(const Clip& clip, const Vector& own, const Vector& shared) {
  Vector d(clip.space.tangent_size());
  d(clip.own) = own;
  d(clip.shared) = shared;
  return d;
}

Eigen::Quaterniond rotation_of(const Node& node, Eigen::Index offset) {
  return {node.x[offset], node.x[offset + 1], node.x[offset + 2], node.x[offset + 3]};
}

/// Weighted second difference of nodes k, k+1, k+2 at the given moves; with derivatives by each of
/// the three if asked.
Vector temporal_residuals(const Clip& clip, std::size_t k,
                          const std::array<const double*, 3>& moves,
                          std::array<RowMajor, 3>* jacobians) {
  const auto n = static_cast<Eigen::Index>(clip.own.size());
  const std::array<const Node*, 3> node{&clip.nodes[k], &clip.nodes[k + 1], &clip.nodes[k + 2]};
  constexpr std::array<double, 3> stencil{1.0, -2.0, 1.0};
  Vector r = Vector::Zero(n);
  if (jacobians != nullptr) {
    for (RowMajor& J : *jacobians) J.setZero(n, n);
  }
  for (std::size_t e = 0; e < clip.euclidean.size(); ++e) {
    const Eigen::Index i = clip.euclidean[e];
    for (std::size_t m = 0; m < 3; ++m) {
      r[i] += stencil[m] * (node[m]->x[clip.euclidean_offsets[e]] + moves[m][i]);
      if (jacobians != nullptr) (*jacobians)[m](i, i) = stencil[m] * clip.weight[i];
    }
  }
  for (std::size_t e = 0; e < clip.rotations.size(); ++e) {
    const Eigen::Index i = clip.rotations[e], at = clip.rotation_offsets[e];
    const auto d = [&](std::size_t m) { return Eigen::Map<const Eigen::Vector3d>(moves[m] + i); };
    const RotationStep before(rotation_of(*node[0], at), d(0), rotation_of(*node[1], at), d(1));
    const RotationStep after(rotation_of(*node[1], at), d(1), rotation_of(*node[2], at), d(2));
    r.segment<3>(i) = after.vector - before.vector;
    if (jacobians == nullptr) continue;
    const auto weight = clip.weight.segment<3>(i).asDiagonal();
    (*jacobians)[0].block<3, 3>(i, i) = weight * -before.by_first;
    (*jacobians)[1].block<3, 3>(i, i) = weight * (after.by_first - before.by_second);
    (*jacobians)[2].block<3, 3>(i, i) = weight * after.by_second;
  }
  return clip.weight.cwiseProduct(r);
}

// ---- Setting up ------------------------------------------------------------------------------

void check(const ParameterSpace& space, const std::vector<ClipFrame>& frames,
           const ClipSmootherOptions& options) {
  const Eigen::Index n = space.tangent_size();
  if (options.acceleration_sigma.size() != n) {
    throw InvalidInput("clip smoother: acceleration_sigma has " +
                       std::to_string(options.acceleration_sigma.size()) + " entries, expected " +
                       std::to_string(n));
  }
  if (!(options.acceleration_sigma.array() > 0.0).all()) {
    throw InvalidInput("clip smoother: every acceleration_sigma must be positive");
  }
  for (const int block : options.shared_blocks) {
    if (block < 0 || block >= static_cast<int>(space.blocks().size())) {
      throw InvalidInput("clip smoother: there is no block " + std::to_string(block) + " to share");
    }
    if (space.blocks()[block].manifold == Manifold::rotation) {
      throw InvalidInput("clip smoother: the rotation '" + space.blocks()[block].name +
                         "' cannot be shared by all frames");
    }
  }
  for (std::size_t f = 0; f < frames.size(); ++f) {
    if (!frames[f].model) continue;
    const NormalEquations& model = *frames[f].model;
    const bool fits = frames[f].x.size() == space.size() && model.gradient.size() == n &&
                      model.hessian.rows() == n && model.hessian.cols() == n;
    if (!fits || !frames[f].x.allFinite() || !model.gradient.allFinite() ||
        !model.hessian.allFinite() || !std::isfinite(model.cost)) {
      throw InvalidInput("clip smoother: frame " + std::to_string(f) +
                         " has a wrong size or values that are not finite");
    }
  }
}

/// Sorts the entries into own and shared ones, rotations and the rest.
void sort_entries(const ClipSmootherOptions& options, Clip& clip) {
  const auto& blocks = clip.space.blocks();
  for (int b = 0; b < static_cast<int>(blocks.size()); ++b) {
    const bool shared =
        std::count(options.shared_blocks.begin(), options.shared_blocks.end(), b) > 0;
    const bool rotation = blocks[b].manifold == Manifold::rotation;
    if (rotation) {
      clip.rotations.push_back(static_cast<Eigen::Index>(clip.own.size()));
      clip.rotation_offsets.push_back(clip.space.offset(b));
    }
    for (int i = 0; i < ParameterSpace::tangent_size(blocks[b]); ++i) {
      if (!shared && !rotation) {
        clip.euclidean.push_back(static_cast<Eigen::Index>(clip.own.size()));
        clip.euclidean_offsets.push_back(clip.space.offset(b) + i);
      }
      (shared ? clip.shared : clip.own).push_back(clip.space.tangent_offset(b) + i);
    }
  }
  clip.weight = options.acceleration_sigma.cwiseInverse()(clip.own);
}

/// Square root of the data term. What the data do not determine, by their rounding error (images
/// are summed in single precision, relative to the diagonal), gets that much and no gradient.
void set_data_term(const NormalEquations& model, const Vector& from_model, const Vector& scale,
                   Node& node) {
  constexpr double rounding = 1e-7;
  Matrix hessian = model.hessian;
  hessian.diagonal() += (undetermined_scales * scale).cwiseAbs2().cwiseInverse();
  const Vector unit = hessian.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(unit.asDiagonal() * hessian *
                                                    unit.asDiagonal());
  const Vector turned = eigen.eigenvectors().transpose() * unit.cwiseProduct(model.gradient);
  const Vector root = eigen.eigenvalues().cwiseMax(rounding).cwiseSqrt();
  const Vector offset =
      (eigen.eigenvalues().array() > rounding).select(turned.cwiseQuotient(root), 0.0);
  node.root =
      root.asDiagonal() * eigen.eigenvectors().transpose() * unit.cwiseInverse().asDiagonal();
  node.constant = model.cost - 0.5 * offset.squaredNorm();
  node.offset = offset + node.root * from_model;
}

/// Nodes for frames with data and for gaps that are bridged, numbered in chains.
void add_nodes(const std::vector<ClipFrame>& frames, int longest_bridge, Clip& clip) {
  std::optional<std::size_t> last;
  int chain = 0;
  for (std::size_t f = 0; f < frames.size(); ++f) {
    if (!frames[f].model) continue;
    const std::size_t gap = last ? f - *last - 1 : 0;
    if (last && gap > static_cast<std::size_t>(std::max(longest_bridge, 0))) {
      ++chain;
    } else if (last) {
      const Vector way = clip.space.minus(frames[f].x, frames[*last].x);
      for (std::size_t g = *last + 1; g < f; ++g) {
        const double share = static_cast<double>(g - *last) / static_cast<double>(f - *last);
        Node node;
        node.frame = g;
        node.bridged = true;
        node.chain = chain;
        node.x = clip.space.plus(frames[*last].x, share * way);
        clip.nodes.push_back(std::move(node));
      }
    }
    Node node;
    node.frame = f;
    node.chain = chain;
    node.x = clip.space.plus(frames[f].x, Vector::Zero(clip.space.tangent_size()));
    clip.nodes.push_back(std::move(node));
    last = f;
  }
}

void set_data_terms(const std::vector<ClipFrame>& frames, Clip& clip) {
  const Vector scale = clip.space.tangent_scale();
  const Eigen::Index n = clip.space.tangent_size();
  const Vector reference = clip.nodes.front().x;
  parallel_for(clip.nodes.size(), [&](std::size_t k) {
    Node& node = clip.nodes[k];
    // All nodes start from the same shared values: their models are moved there.
    Vector move = Vector::Zero(n);
    move(clip.shared) = clip.space.minus(reference, node.x)(clip.shared);
    node.x = clip.space.plus(node.x, move);
    node.d = Vector::Zero(static_cast<Eigen::Index>(clip.own.size()));
    if (node.bridged) {
      Vector root = (undetermined_scales * scale).cwiseInverse();
      root(clip.shared).setZero();  // a frame without data says nothing of the identity
      node.root = root.asDiagonal();
      node.offset = Vector::Zero(n);
    } else {
      set_data_term(*frames[node.frame].model, move, scale, node);
    }
  });
  clip.d_shared = Vector::Zero(static_cast<Eigen::Index>(clip.shared.size()));
  clip.held.assign(clip.nodes.size(), std::vector<char>(clip.own.size(), 0));
  clip.held_shared.assign(clip.shared.size(), 0);
}

// ---- Ceres -----------------------------------------------------------------------------------

void zero_held_columns(const std::vector<char>& held, Eigen::Map<RowMajor>& J) {
  for (std::size_t i = 0; i < held.size(); ++i) {
    if (held[i] != 0) J.col(static_cast<Eigen::Index>(i)).setZero();
  }
}

class DataTerm final : public ceres::CostFunction {
 public:
  DataTerm(const Clip& clip, std::size_t k) : clip_(clip), k_(k) {
    set_num_residuals(static_cast<int>(clip.space.tangent_size()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(clip.own.size()));
    if (!clip.shared.empty()) {
      mutable_parameter_block_sizes()->push_back(static_cast<int>(clip.shared.size()));
    }
  }
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const Node& node = clip_.nodes[k_];
    const auto own = static_cast<Eigen::Index>(clip_.own.size());
    const auto shared = static_cast<Eigen::Index>(clip_.shared.size());
    const Vector shared_moves =
        shared > 0 ? Vector(Eigen::Map<const Vector>(parameters[1], shared)) : Vector();
    Eigen::Map<Vector>(residuals, num_residuals()) =
        node.root * all_entries(clip_, Eigen::Map<const Vector>(parameters[0], own), shared_moves) +
        node.offset;
    if (jacobians == nullptr) return true;
    if (jacobians[0] != nullptr) {
      Eigen::Map<RowMajor> J(jacobians[0], num_residuals(), own);
      J = node.root(Eigen::all, clip_.own);
      zero_held_columns(clip_.held[k_], J);
    }
    if (shared > 0 && jacobians[1] != nullptr) {
      Eigen::Map<RowMajor> J(jacobians[1], num_residuals(), shared);
      J = node.root(Eigen::all, clip_.shared);
      zero_held_columns(clip_.held_shared, J);
    }
    return true;
  }

 private:
  const Clip& clip_;
  std::size_t k_;
};

class TemporalTerm final : public ceres::CostFunction {
 public:
  TemporalTerm(const Clip& clip, std::size_t k) : clip_(clip), k_(k) {
    const int n = static_cast<int>(clip.own.size());
    set_num_residuals(n);
    mutable_parameter_block_sizes()->assign(3, n);
  }
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const auto n = static_cast<Eigen::Index>(clip_.own.size());
    std::array<RowMajor, 3> derivatives;
    Eigen::Map<Vector>(residuals, n) =
        temporal_residuals(clip_, k_, {parameters[0], parameters[1], parameters[2]},
                           jacobians != nullptr ? &derivatives : nullptr);
    for (std::size_t m = 0; jacobians != nullptr && m < 3; ++m) {
      if (jacobians[m] == nullptr) continue;
      Eigen::Map<RowMajor> J(jacobians[m], n, n);
      J = derivatives[m];
      zero_held_columns(clip_.held[k_ + m], J);
    }
    return true;
  }

 private:
  const Clip& clip_;
  std::size_t k_;
};

class CancelCallback final : public ceres::IterationCallback {
 public:
  explicit CancelCallback(const Progress& progress) : progress_(progress) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    return progress_.cancelled() ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }

 private:
  const Progress& progress_;
};

void build_problem(Clip& clip, ceres::Problem& problem) {
  for (std::size_t k = 0; k < clip.nodes.size(); ++k) {
    std::vector<double*> blocks{clip.nodes[k].d.data()};
    if (!clip.shared.empty()) blocks.push_back(clip.d_shared.data());
    problem.AddResidualBlock(new DataTerm(clip, k), nullptr, blocks);
    if (!clip.triple(k)) continue;
    problem.AddResidualBlock(new TemporalTerm(clip, k), nullptr, clip.nodes[k].d.data(),
                             clip.nodes[k + 1].d.data(), clip.nodes[k + 2].d.data());
  }
}

ceres::Solver::Options solver_options() {
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  solver.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
  solver.logging_type = ceres::SILENT;
  solver.num_threads = 1;  // the order of Ceres' sums depends on the number of threads
  solver.max_num_iterations = 30;
  solver.initial_trust_region_radius = 1e12;  // only the rotations are not linear
  solver.function_tolerance = 1e-10;
  solver.parameter_tolerance = 1e-12;
  solver.gradient_tolerance = 0.0;
  return solver;
}

// ---- Bounds ----------------------------------------------------------------------------------

/// Gradient of the whole cost by the own moves of each node and, last, by the shared ones.
std::vector<Vector> total_gradient(const Clip& clip) {
  std::vector<Vector> gradient(clip.nodes.size() + 1);
  gradient.back() = Vector::Zero(static_cast<Eigen::Index>(clip.shared.size()));
  for (std::size_t k = 0; k < clip.nodes.size(); ++k) {
    const Node& node = clip.nodes[k];
    const Vector slope = node.root.transpose() *
                         (node.root * all_entries(clip, node.d, clip.d_shared) + node.offset);
    gradient[k] = slope(clip.own);
    gradient.back() += slope(clip.shared);
  }
  for (std::size_t k = 0; k < clip.nodes.size(); ++k) {
    if (!clip.triple(k)) continue;
    std::array<RowMajor, 3> J;
    const Vector r = temporal_residuals(
        clip, k, {clip.nodes[k].d.data(), clip.nodes[k + 1].d.data(), clip.nodes[k + 2].d.data()},
        &J);
    for (std::size_t m = 0; m < 3; ++m) gradient[k + m] += J[m].transpose() * r;
  }
  return gradient;
}

/// Holds entries that left their bounds, frees held ones that want to come back. Returns how many
/// changed.
int update_held(const Vector& lower, const Vector& upper, const Vector& gradient,
                const Vector& scale, bool may_free, Vector& d, std::vector<char>& held) {
  constexpr double tolerance = 1e-9;
  int changes = 0;
  for (Eigen::Index i = 0; i < d.size(); ++i) {
    const double slack = tolerance * scale[i];
    char& state = held[static_cast<std::size_t>(i)];
    if (state != 0) {
      const bool inward =
          (d[i] <= lower[i] && gradient[i] < 0.0) || (d[i] >= upper[i] && gradient[i] > 0.0);
      if (!may_free || !inward || lower[i] >= upper[i]) continue;
      state = 0;
      ++changes;
    } else if (d[i] < lower[i] - slack || d[i] > upper[i] + slack) {
      d[i] = std::clamp(d[i], lower[i], upper[i]);
      state = 1;
      ++changes;
    }
  }
  return changes;
}

int update_all_held(bool may_free, Clip& clip) {
  const std::vector<Vector> gradient = total_gradient(clip);
  const Vector scale = clip.space.tangent_scale();
  Vector lower, upper;
  int changes = 0;
  for (std::size_t k = 0; k < clip.nodes.size(); ++k) {
    clip.space.tangent_bounds(clip.nodes[k].x, lower, upper);
    changes += update_held(lower(clip.own), upper(clip.own), gradient[k], scale(clip.own), may_free,
                           clip.nodes[k].d, clip.held[k]);
  }
  clip.space.tangent_bounds(clip.nodes.front().x, lower, upper);
  return changes + update_held(lower(clip.shared), upper(clip.shared), gradient.back(),
                               scale(clip.shared), may_free, clip.d_shared, clip.held_shared);
}

/// Solves within the bounds. Ceres' own bounds project each step and can stall; here entries that
/// leave are put on their bound and held, and are freed again where that lowers the cost.
bool solve(Clip& clip, Progress& progress) {
  constexpr int rounds_with_freeing = 5, most_rounds = 20;
  ceres::Problem problem;
  build_problem(clip, problem);
  CancelCallback callback(progress);
  ceres::Solver::Options options = solver_options();
  options.callbacks.push_back(&callback);
  for (int round = 0; round < most_rounds; ++round) {
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    const bool solved = summary.termination_type == ceres::CONVERGENCE;
    const int changes = update_all_held(round < rounds_with_freeing, clip);
    if (!solved) return false;
    if (changes == 0) return true;
  }
  return false;
}

double total_cost(const Clip& clip) {
  double cost = 0.0;
  for (std::size_t k = 0; k < clip.nodes.size(); ++k) {
    const Node& node = clip.nodes[k];
    cost +=
        node.constant +
        0.5 * (node.root * all_entries(clip, node.d, clip.d_shared) + node.offset).squaredNorm();
    if (!clip.triple(k)) continue;
    cost +=
        0.5 * temporal_residuals(
                  clip, k, {node.d.data(), clip.nodes[k + 1].d.data(), clip.nodes[k + 2].d.data()},
                  nullptr)
                  .squaredNorm();
  }
  return cost;
}

// ---- Covariance ------------------------------------------------------------------------------

std::vector<ClipColumn> hessian_columns(const Clip& clip, Matrix& shared) {
  const auto n = static_cast<Eigen::Index>(clip.own.size());
  const auto s = static_cast<Eigen::Index>(clip.shared.size());
  shared.setZero(s, s);
  std::vector<ClipColumn> columns(clip.nodes.size());
  for (std::size_t k = 0; k < clip.nodes.size(); ++k) {
    const Matrix hessian = clip.nodes[k].root.transpose() * clip.nodes[k].root;
    columns[k] = {hessian(clip.own, clip.own), Matrix::Zero(n, n), Matrix::Zero(n, n),
                  hessian(clip.shared, clip.own)};
    shared += hessian(clip.shared, clip.shared);
  }
  for (std::size_t k = 0; k < clip.nodes.size(); ++k) {
    if (!clip.triple(k)) continue;
    std::array<RowMajor, 3> J;
    temporal_residuals(
        clip, k, {clip.nodes[k].d.data(), clip.nodes[k + 1].d.data(), clip.nodes[k + 2].d.data()},
        &J);
    for (std::size_t m = 0; m < 3; ++m) columns[k + m].diagonal += J[m].transpose() * J[m];
    columns[k].next += J[1].transpose() * J[0];
    columns[k + 1].next += J[2].transpose() * J[1];
    columns[k].second += J[2].transpose() * J[0];
  }
  return columns;
}

std::vector<Vector> standard_deviations(const Clip& clip) {
  Matrix shared;
  std::vector<ClipColumn> columns = hessian_columns(clip, shared);
  const ClipVariances variances = clip_variances(std::move(columns), std::move(shared));
  std::vector<Vector> sigma;
  for (const Vector& own : variances.own) {
    sigma.push_back(all_entries(clip, own, variances.shared).cwiseSqrt());
  }
  return sigma;
}

}  // namespace

SmoothedClip smooth_clip(const ParameterSpace& space, const std::vector<ClipFrame>& frames,
                         const ClipSmootherOptions& options, Progress& progress) {
  check(space, frames, options);
  SmoothedClip result;
  result.frames.resize(frames.size());
  Clip clip(space);
  sort_entries(options, clip);
  if (clip.own.empty()) throw InvalidInput("clip smoother: every block is shared");
  add_nodes(frames, options.longest_bridge, clip);
  if (clip.nodes.empty()) return result;
  set_data_terms(frames, clip);

  result.cost_before = total_cost(clip);
  result.converged = solve(clip, progress);
  result.cost_after = total_cost(clip);
  const std::vector<Vector> sigma = standard_deviations(clip);
  const Vector scale = space.tangent_scale();
  for (std::size_t k = 0; k < clip.nodes.size(); ++k) {
    const Node& node = clip.nodes[k];
    const Vector d = all_entries(clip, node.d, clip.d_shared);
    SmoothedFrame& out = result.frames[node.frame];
    out.state = node.bridged ? SmoothedState::bridged : SmoothedState::smoothed;
    out.x = space.plus(node.x, d);
    out.sigma = sigma[k];
    if (node.bridged) continue;
    const Vector move = space.minus(out.x, frames[node.frame].x).cwiseQuotient(scale);
    result.largest_move = std::max(result.largest_move, move.cwiseAbs().maxCoeff());
  }
  return result;
}

}  // namespace semblance
