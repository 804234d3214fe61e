// Ceres on the same Objective, as a cross-check of Levenberg-Marquardt.
//
// Ceres wants residuals; an image objective only offers its normal equations. With H = J'J for the
// square J made from the eigenvectors of H, the residuals J^-T g and one more of the right size
// with a zero Jacobian have exactly the cost, the gradient and the Gauss-Newton Hessian of the
// image, so Ceres takes the steps it would take on the millions of pixels.
#include <ceres/ceres.h>

#include <Eigen/Eigenvalues>
#include <cmath>

#include "box_qp.h"
#include "methods.h"
#include "run.h"
#include "semblance/core/rigid3.h"

namespace semblance {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Unit quaternions (w, x, y, z) that move by exp(d) q.
class LeftRotation final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 4; }
  int TangentSize() const override { return 3; }
  bool Plus(const double* x, const double* delta, double* moved) const override {
    const Eigen::Map<const Eigen::Vector3d> d(delta);
    write((quaternion_from_rotation_vector(d) * read(x)).normalized(), moved);
    return true;
  }
  bool PlusJacobian(const double* x, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 4, 3, Eigen::RowMajor>> J(jacobian);
    const Eigen::Quaterniond q = read(x);
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d axis = 0.5 * Eigen::Vector3d::Unit(i);
      Eigen::Vector4d column;
      write(Eigen::Quaterniond(0.0, axis.x(), axis.y(), axis.z()) * q, column.data());
      J.col(i) = column;
    }
    return true;
  }
  bool Minus(const double* y, const double* x, double* delta) const override {
    Eigen::Map<Eigen::Vector3d> d(delta);
    d = rotation_vector_from_quaternion(read(y) * read(x).conjugate());
    return true;
  }
  bool MinusJacobian(const double* x, double* jacobian) const override {
    Eigen::Matrix<double, 4, 3, Eigen::RowMajor> plus;
    PlusJacobian(x, plus.data());
    Eigen::Map<Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> J(jacobian);
    J = 4.0 * plus.transpose();  // the columns of `plus` are orthogonal and of length 1/2
    return true;
  }

 private:
  static Eigen::Quaterniond read(const double* x) { return {x[0], x[1], x[2], x[3]}; }
  static void write(const Eigen::Quaterniond& q, double* x) {
    x[0] = q.w();
    x[1] = q.x();
    x[2] = q.y();
    x[3] = q.z();
  }
};

/// Square J and r with J'J = hessian, J'r = gradient and |r|^2 <= 2 cost. Eigenvalues below the
/// working precision of the largest, in units of `scale`, are raised to it. Where the Hessian is
/// not one of least squares and promises more than the whole cost, it is enlarged until it does
/// not.
struct CompressedResiduals {
  Eigen::MatrixXd jacobian;
  Eigen::VectorXd residuals;

  CompressedResiduals(const NormalEquations& model, const Eigen::VectorXd& scale) {
    constexpr double smallest_share = 1e-12;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * model.hessian *
                                                               scale.asDiagonal());
    const double floor = std::max(smallest_share * eigen.eigenvalues().maxCoeff(), 1e-300);
    const Eigen::VectorXd root = eigen.eigenvalues().cwiseMax(floor).cwiseSqrt();
    residuals = root.cwiseInverse().asDiagonal() *
                (eigen.eigenvectors().transpose() * scale.cwiseProduct(model.gradient));
    jacobian =
        root.asDiagonal() * eigen.eigenvectors().transpose() * scale.cwiseInverse().asDiagonal();
    const double promised = residuals.squaredNorm(), available = 2.0 * model.cost;
    if (promised > available && available > 0.0) {
      const double enlarge = std::sqrt(promised / available);
      residuals /= enlarge;
      jacobian *= enlarge;
    }
  }
};

/// The objective as one Ceres cost over all blocks.
class ObjectiveCost final : public ceres::CostFunction {
 public:
  ObjectiveCost(Run& run, const ParameterSpace& space)
      : run_(run), space_(space), scale_(space.tangent_scale()) {
    for (const ParameterBlock& block : space.blocks()) {
      mutable_parameter_block_sizes()->push_back(block.size);
    }
    set_num_residuals(static_cast<int>(space.tangent_size()) + 1);
  }

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    Eigen::Map<Eigen::VectorXd> r(residuals, num_residuals());
    const Eigen::VectorXd x = gather(parameters);
    r.setZero();
    if (jacobians == nullptr) {  // a trial step: Ceres looks at the cost only
      const double cost = run_.evaluate(x);
      constexpr double refused = 1e150;  // a failed evaluation would be written to stderr
      r[r.size() - 1] = std::isfinite(cost) ? std::sqrt(2.0 * cost) : refused;
      return true;
    }
    if (!linearised_at(x) && !linearise(x)) return false;
    const CompressedResiduals compressed(free_model(x), scale_);
    r.head(r.size() - 1) = compressed.residuals;
    r[r.size() - 1] =
        std::sqrt(std::max(0.0, 2.0 * model_.cost - compressed.residuals.squaredNorm()));
    scatter(compressed.jacobian, parameters, jacobians);
    return true;
  }

  /// Takes the normal equations at x, which `Evaluate` then uses; false where it cannot.
  bool linearise(const Eigen::VectorXd& x) const {
    const bool usable = run_.normal_equations(x, model_);
    model_at_ = usable ? x : Eigen::VectorXd();
    return usable;
  }
  bool linearised_at(const Eigen::VectorXd& x) const {
    return model_at_.size() == x.size() && model_at_ == x;
  }
  /// The last normal equations.
  const NormalEquations& model() const { return model_; }

 private:
  /// The model without the directions that the best step within the bounds leaves on a bound. Ceres
  /// projects its steps, and stalls away from the minimum if they keep pushing against one.
  NormalEquations free_model(const Eigen::VectorXd& x) const {
    constexpr double ridge = 1e-10, near = 1e-9;
    Eigen::VectorXd lower, upper, step;
    space_.tangent_bounds(x, lower, upper);
    const Eigen::ArrayXd square = scale_.array().square();
    NormalEquations model = model_;
    model.hessian.diagonal().array() +=
        ridge * (model_.hessian.diagonal().array() * square).maxCoeff() / square;
    if (!solve_box_qp(model.hessian, model.gradient, lower, upper, step)) return model_;
    model = model_;
    for (Eigen::Index i = 0; i < lower.size(); ++i) {
      const bool held = (step[i] <= lower[i] && lower[i] >= -near * scale_[i]) ||
                        (step[i] >= upper[i] && upper[i] <= near * scale_[i]);
      if (!held) continue;
      model.gradient[i] = 0.0;
      model.hessian.row(i).setZero();
      model.hessian.col(i).setZero();
    }
    return model;
  }

  Eigen::VectorXd gather(double const* const* parameters) const {
    Eigen::VectorXd x(space_.size());
    for (std::size_t b = 0; b < space_.blocks().size(); ++b) {
      const int size = space_.blocks()[b].size;
      x.segment(space_.offset(static_cast<int>(b)), size) =
          Eigen::Map<const Eigen::VectorXd>(parameters[b], size);
    }
    return x;
  }

  void scatter(const Eigen::MatrixXd& tangent, double const* const* parameters,
               double** jacobians) const {
    for (std::size_t b = 0; b < space_.blocks().size(); ++b) {
      if (jacobians[b] == nullptr) continue;
      const ParameterBlock& block = space_.blocks()[b];
      const auto columns = tangent.middleCols(space_.tangent_offset(static_cast<int>(b)),
                                              ParameterSpace::tangent_size(block));
      Eigen::Map<RowMajor> J(jacobians[b], num_residuals(), block.size);
      J.setZero();
      if (block.manifold == Manifold::rotation) {
        Eigen::Matrix<double, 3, 4, Eigen::RowMajor> minus;
        LeftRotation().MinusJacobian(parameters[b], minus.data());
        J.topRows(tangent.rows()) = columns * minus;
      } else {
        J.topRows(tangent.rows()) = columns;
      }
    }
  }

  Run& run_;
  const ParameterSpace& space_;
  Eigen::VectorXd scale_;
  mutable NormalEquations model_;  // Ceres evaluates through const functions
  mutable Eigen::VectorXd model_at_;
};

/// Stops when asked to, and when an accepted step is below its tolerance.
class Watch final : public ceres::IterationCallback {
 public:
  Watch(const Run& run, const ParameterSpace& space, const Eigen::VectorXd& x, double tolerance)
      : run_(run), space_(space), x_(x), last_(x), limit_(tolerance * space.tangent_scale()) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    if (run_.cancelled()) return ceres::SOLVER_ABORT;
    if (summary.iteration == 0 || !summary.step_is_successful) return ceres::SOLVER_CONTINUE;
    const Eigen::VectorXd step = space_.minus(x_, last_);
    last_ = x_;
    const bool small = (step.array().abs() <= limit_.array()).all();
    return small ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  const Run& run_;
  const ParameterSpace& space_;
  const Eigen::VectorXd& x_;
  Eigen::VectorXd last_, limit_;
};

void add_blocks(const ParameterSpace& space, ceres::Problem& problem,
                std::vector<double*>& blocks) {
  for (std::size_t b = 0; b < space.blocks().size(); ++b) {
    const ParameterBlock& block = space.blocks()[b];
    if (block.manifold == Manifold::rotation) {
      problem.AddParameterBlock(blocks[b], block.size, new LeftRotation);
      continue;
    }
    std::vector<int> fixed;
    for (int i = 0; i < block.size; ++i) {
      if (block.lower[i] >= block.upper[i]) fixed.push_back(i);
    }
    problem.AddParameterBlock(blocks[b], block.size);
    if (static_cast<int>(fixed.size()) == block.size) {
      problem.SetParameterBlockConstant(blocks[b]);
      continue;
    }
    if (!fixed.empty()) {
      problem.SetManifold(blocks[b], new ceres::SubsetManifold(block.size, fixed));
    }
    for (int i = 0; i < block.size; ++i) {
      if (block.lower[i] >= block.upper[i]) continue;
      if (std::isfinite(block.lower[i]))
        problem.SetParameterLowerBound(blocks[b], i, block.lower[i]);
      if (std::isfinite(block.upper[i]))
        problem.SetParameterUpperBound(blocks[b], i, block.upper[i]);
    }
  }
}

class CeresOptimizer final : public Optimizer {
 public:
  explicit CeresOptimizer(const OptimizerOptions& options) : options_(options) {}
  std::string name() const override { return "ceres"; }
  Solution minimize(const Objective& objective, const Eigen::VectorXd& x0,
                    Progress& progress) const override;

 private:
  ceres::Solver::Options solver_options() const;
  OptimizerOptions options_;
};

ceres::Solver::Options CeresOptimizer::solver_options() const {
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_QR;
  solver.logging_type = ceres::SILENT;
  solver.num_threads = 1;
  solver.max_num_iterations = options_.max_iterations;
  solver.initial_trust_region_radius = 1.0 / std::max(options_.initial_damping, 1e-16);
  solver.function_tolerance = options_.cost_tolerance;
  solver.parameter_tolerance = 0.0;  // `Watch` knows the scale of each parameter
  solver.gradient_tolerance = 0.0;
  solver.update_state_every_iteration = true;
  return solver;
}

Solution CeresOptimizer::minimize(const Objective& objective, const Eigen::VectorXd& x0,
                                  Progress& progress) const {
  const ParameterSpace& space = objective.space();
  Run run(objective, x0, progress);
  Eigen::VectorXd x = run.start();
  std::vector<double*> blocks;
  for (std::size_t b = 0; b < space.blocks().size(); ++b) {
    blocks.push_back(x.data() + space.offset(static_cast<int>(b)));
  }
  ceres::Problem problem;
  add_blocks(space, problem, blocks);
  auto* cost = new ObjectiveCost(run, space);  // owned by the problem
  problem.AddResidualBlock(cost, nullptr, blocks);
  if (!cost->linearise(x)) {  // Ceres itself would write this to stderr
    run.evaluate(x);
    return run.finish(Termination::failed, "the start cannot be evaluated");
  }

  Watch watch(run, space, x, options_.step_tolerance);
  ceres::Solver::Options solver = solver_options();
  solver.callbacks.push_back(&watch);
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);

  Termination termination = Termination::converged;
  if (run.cancelled()) {
    termination = Termination::cancelled;
  } else if (summary.termination_type == ceres::NO_CONVERGENCE) {
    termination = Termination::iteration_limit;
  } else if (summary.termination_type == ceres::FAILURE) {
    termination = Termination::failed;
  }
  NormalEquations model = cost->model();
  const bool usable = cost->linearised_at(run.best()) || run.normal_equations(run.best(), model);
  Solution solution = run.finish(termination, summary.message);
  if (usable) solution.covariance = covariance_from_hessian(model.hessian, space.tangent_scale());
  return solution;
}

}  // namespace

std::unique_ptr<Optimizer> make_ceres(const OptimizerOptions& options) {
  return std::make_unique<CeresOptimizer>(options);
}

}  // namespace semblance
