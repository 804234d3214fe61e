#include "semblance/optim/contract.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <atomic>
#include <cmath>
#include <limits>
#include <sstream>

#include "semblance/core/parallel.h"
#include "semblance/core/random.h"
#include "semblance/core/rigid3.h"

namespace semblance {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

class Report {
 public:
  template <class... Parts>
  void expect(bool holds, const Parts&... parts) {
    if (holds) return;
    (text_ << ... << parts) << '\n';
  }
  std::string text() const { return text_.str(); }

 private:
  std::ostringstream text_;
};

ParameterSpace box_space(const Eigen::VectorXd& lower, const Eigen::VectorXd& upper) {
  ParameterBlock block;
  block.name = "x";
  block.size = static_cast<int>(lower.size());
  block.lower = lower;
  block.upper = upper;
  block.prior_sigma = Eigen::VectorXd::Constant(block.size, 3.0);  // the size of a step
  block.prior_mean = lower;
  return ParameterSpace({block});
}

/// Least squares given by residuals and Jacobian in the tangent space, with an optional region
/// where it cannot be evaluated.
class Problem : public Objective {
 public:
  explicit Problem(ParameterSpace space) : space_(std::move(space)) {}
  const ParameterSpace& space() const final { return space_; }
  double evaluate(const Eigen::VectorXd& x) const final {
    if (forbidden && forbidden(x)) return infinity;
    return 0.5 * residuals(x, nullptr).squaredNorm();
  }
  bool normal_equations(const Eigen::VectorXd& x, NormalEquations& out) const final {
    if (forbidden && forbidden(x)) return false;
    Eigen::MatrixXd jacobian;
    const Eigen::VectorXd r = residuals(x, &jacobian);
    out.hessian = jacobian.transpose() * jacobian;
    out.gradient = jacobian.transpose() * r;
    out.cost = 0.5 * r.squaredNorm();
    return true;
  }

  std::function<bool(const Eigen::VectorXd&)> forbidden;

 private:
  virtual Eigen::VectorXd residuals(const Eigen::VectorXd& x, Eigen::MatrixXd* jacobian) const = 0;
  ParameterSpace space_;
};

/// Residuals s_i (x_i - c_i) in turned axes, s from 1 to 10; the minimum of the bounded version
/// has two entries on their bounds.
class Quadratic final : public Problem {
 public:
  explicit Quadratic(double bound)
      : Problem(
            box_space(Eigen::VectorXd::Constant(5, -bound), Eigen::VectorXd::Constant(5, bound))) {
    Random random(11);
    Eigen::MatrixXd any(5, 5);
    for (int j = 0; j < 5; ++j) any.col(j) = random.normal_vector(5);
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(any, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Eigen::VectorXd stretch = Eigen::VectorXd::LinSpaced(5, 1.0, 10.0);
    a_ = stretch.asDiagonal() * svd.matrixV().transpose();
    centre << 0.8, -0.5, 0.3, -0.9, 0.1;
  }
  Eigen::VectorXd centre = Eigen::VectorXd(5);

 private:
  Eigen::VectorXd residuals(const Eigen::VectorXd& x, Eigen::MatrixXd* jacobian) const override {
    if (jacobian != nullptr) *jacobian = a_;
    return a_ * (x - centre);
  }
  Eigen::MatrixXd a_;
};

/// Rosenbrock 1960: (1 - x)^2 + 100 (y - x^2)^2, halved.
class Rosenbrock final : public Problem {
 public:
  Rosenbrock() : Problem(box_space(Eigen::Vector2d(-3, -3), Eigen::Vector2d(3, 3))) {}

 private:
  Eigen::VectorXd residuals(const Eigen::VectorXd& x, Eigen::MatrixXd* jacobian) const override {
    if (jacobian != nullptr) {
      jacobian->resize(2, 2);
      *jacobian << -1.0, 0.0, -20.0 * x[0], 10.0;
    }
    return Eigen::Vector2d(1.0 - x[0], 10.0 * (x[1] - x[0] * x[0]));
  }
};

ParameterSpace rotation_space() {
  ParameterBlock block = rotation_block("rotation", "");
  block.prior_mean = Eigen::Vector4d(1.0, 0.0, 0.0, 0.0);
  block.prior_sigma = Eigen::Vector3d::Constant(1.5);
  return ParameterSpace({block});
}

/// Wahba 1965: the rotation R with R from_i ~ to_i for noisy directions.
class Wahba final : public Problem {
 public:
  Wahba() : Problem(rotation_space()) {
    Random random(12);
    const Eigen::Quaterniond truth = quaternion_from_rotation_vector({0.7, -0.6, 0.5});
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (int i = 0; i < 8; ++i) {
      from_.col(i) = Eigen::Vector3d(random.normal_vector(3)).normalized();
      to_.col(i) = (truth * from_.col(i) + 0.05 * random.normal_vector(3)).normalized();
      sum += to_.col(i) * from_.col(i).transpose();
    }
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const double sign = svd.matrixU().determinant() * svd.matrixV().determinant();
    answer = Eigen::Quaterniond(Eigen::Matrix3d(
        svd.matrixU() * Eigen::Vector3d(1.0, 1.0, sign).asDiagonal() * svd.matrixV().transpose()));
  }
  Eigen::Quaterniond answer;

 private:
  Eigen::VectorXd residuals(const Eigen::VectorXd& x, Eigen::MatrixXd* jacobian) const override {
    const Eigen::Quaterniond q(x[0], x[1], x[2], x[3]);
    const Eigen::Matrix<double, 3, 8> turned = q.toRotationMatrix() * from_;
    if (jacobian != nullptr) {
      jacobian->resize(24, 3);
      for (int i = 0; i < 8; ++i) {
        const Eigen::Vector3d p = turned.col(i);
        jacobian->middleRows<3>(3 * i) << 0, p.z(), -p.y(), -p.z(), 0, p.x(), p.y(), -p.x(), 0;
      }
    }
    return (turned - to_).reshaped();
  }
  Eigen::Matrix<double, 3, 8> from_, to_;
};

/// Counts what is asked of another objective, as Solution::evaluations promises to.
class Counting final : public Objective {
 public:
  explicit Counting(const Objective& inner) : inner_(inner) {}
  const ParameterSpace& space() const override { return inner_.space(); }
  double evaluate(const Eigen::VectorXd& x) const override {
    ++count;
    return inner_.evaluate(x);
  }
  bool normal_equations(const Eigen::VectorXd& x, NormalEquations& out) const override {
    ++count;
    return inner_.normal_equations(x, out);
  }
  mutable std::atomic<std::int64_t> count{0};

 private:
  const Objective& inner_;
};

/// Cancels as soon as the objective was asked a number of times.
class CancelAfter final : public Progress {
 public:
  CancelAfter(const Counting& objective, std::int64_t limit)
      : objective_(objective), limit_(limit) {}
  void begin(const std::string&, std::int64_t) override {}
  void update(std::int64_t) override {}
  void end() override {}
  bool cancelled() const override { return objective_.count >= limit_; }

 private:
  const Counting& objective_;
  std::int64_t limit_;
};

/// Minimises and checks what must hold for every run.
Solution checked_run(const Optimizer& optimizer, const Objective& objective,
                     const Eigen::VectorXd& x0, const std::string& what, Report& report) {
  const Counting counting(objective);
  const Solution solution = optimizer.minimize(counting, x0, silent_progress());
  const double start = objective.evaluate(x0);
  report.expect(solution.evaluations == counting.count, what, ": says ", solution.evaluations,
                " evaluations, made ", counting.count.load());
  report.expect(solution.x.size() == x0.size() && solution.x.allFinite(), what,
                ": x is not finite");
  if (solution.x.size() != x0.size()) return solution;
  report.expect(solution.cost <= start, what, ": ends at ", solution.cost, ", above the start ",
                start);
  const double there = objective.evaluate(solution.x);
  report.expect(there == solution.cost ||
                    std::abs(there - solution.cost) <= 1e-9 * std::abs(solution.cost) + 1e-300,
                what, ": the cost is ", there, " at x, not ", solution.cost);
  const ParameterSpace& space = objective.space();
  const Eigen::VectorXd clamped =
      space.plus(solution.x, Eigen::VectorXd::Zero(space.tangent_size()));
  report.expect((clamped - solution.x).cwiseAbs().maxCoeff() < 1e-12, what,
                ": x is out of its bounds or not a unit quaternion");
  return solution;
}

void check_accuracy(const OptimizerMaker& make, const OptimizerOptions& options,
                    const OptimizerAccuracy& accuracy, Report& report) {
  const std::unique_ptr<Optimizer> optimizer = make(options);
  const Quadratic quadratic(2.0);
  const Solution bowl =
      checked_run(*optimizer, quadratic, Eigen::VectorXd::Constant(5, -1.0), "quadratic", report);
  const double bowl_error = (bowl.x - quadratic.centre).cwiseAbs().maxCoeff();
  report.expect(bowl_error <= accuracy.quadratic, "quadratic: error ", bowl_error, " > ",
                accuracy.quadratic);

  const Solution valley =
      checked_run(*optimizer, Rosenbrock(), Eigen::Vector2d(-1.2, 1.0), "Rosenbrock", report);
  const double valley_error = (valley.x.array() - 1.0).abs().maxCoeff();
  report.expect(valley_error <= accuracy.rosenbrock, "Rosenbrock: error ", valley_error, " > ",
                accuracy.rosenbrock);

  const Wahba wahba;
  const Solution turn = checked_run(*optimizer, wahba, wahba.space().initial(), "rotation", report);
  const Eigen::Quaterniond found(turn.x[0], turn.x[1], turn.x[2], turn.x[3]);
  const double angle = rotation_vector_from_quaternion(found * wahba.answer.conjugate()).norm();
  report.expect(angle <= accuracy.rotation_rad, "rotation: error ", angle, " rad > ",
                accuracy.rotation_rad);
}

/// The unconstrained minimum lies outside the box.
void check_bounds(const OptimizerMaker& make, const OptimizerOptions& options,
                  const OptimizerAccuracy& accuracy, Report& report) {
  const Quadratic tight(0.6);
  const Solution solution =
      checked_run(*make(options), tight, Eigen::VectorXd::Zero(5), "bounds", report);
  // First-order conditions: a small step along the projected gradient gains nothing.
  NormalEquations model;
  tight.normal_equations(solution.x, model);
  const Eigen::VectorXd downhill = tight.space().plus(solution.x, -model.gradient / 100.0);
  const double gain = (downhill - solution.x).cwiseAbs().maxCoeff();
  report.expect(gain <= accuracy.quadratic,
                "bounds: not a minimum within them, a gradient step moves ", gain);
}

void check_threads(const OptimizerMaker& make, const OptimizerOptions& options, Report& report) {
  const int before = thread_count();
  std::vector<Solution> solutions;
  for (const int threads : {1, 2, 2}) {
    set_thread_count(threads);
    solutions.push_back(
        make(options)->minimize(Rosenbrock(), Eigen::Vector2d(-1.2, 1.0), silent_progress()));
  }
  set_thread_count(before);
  for (const Solution& solution : solutions) {
    report.expect(solution.x == solutions[0].x && solution.cost == solutions[0].cost &&
                      solution.evaluations == solutions[0].evaluations,
                  "threads: the result changes from run to run or with their number");
  }
}

void check_cancellation(const OptimizerMaker& make, OptimizerOptions options, Report& report) {
  options.step_tolerance = options.cost_tolerance = 0.0;
  const std::int64_t slack = 2 * options.population + 10;
  for (const std::int64_t limit : {0, 5, 60}) {
    const Rosenbrock rosenbrock;
    const Counting counting(rosenbrock);
    CancelAfter progress(counting, limit);
    const Eigen::VectorXd x0 = Eigen::Vector2d(-1.2, 1.0);
    const Solution solution = make(options)->minimize(counting, x0, progress);
    const bool in_time = counting.count <= limit + slack;
    report.expect(in_time, "cancellation: asked to stop after ", limit, " evaluations, made ",
                  counting.count.load());
    report.expect(solution.termination == Termination::cancelled || counting.count < limit,
                  "cancellation: the termination does not say so");
    report.expect(
        solution.cost <= rosenbrock.evaluate(x0) && solution.evaluations == counting.count,
        "cancellation: lost the best so far or the count");
  }
}

void check_infinite_regions(const OptimizerMaker& make, const OptimizerOptions& options,
                            Report& report) {
  Quadratic holed(2.0);
  holed.forbidden = [](const Eigen::VectorXd& x) { return x[0] > 0.5 || x[1] * x[2] > 0.3; };
  const Solution survived = checked_run(*make(options), holed, Eigen::VectorXd::Constant(5, -0.1),
                                        "infinite region", report);
  report.expect(std::isfinite(survived.cost), "infinite region: ends inside it");

  Quadratic hopeless(2.0);
  hopeless.forbidden = [](const Eigen::VectorXd&) { return true; };
  const Solution failed = checked_run(*make(options), hopeless, Eigen::VectorXd::Zero(5),
                                      "infinite everywhere", report);
  report.expect(failed.termination == Termination::failed,
                "infinite everywhere: the termination does not say failed");
}

void check_model(const Objective& objective, const Eigen::VectorXd& x, const NormalEquations& model,
                 const ObjectiveAccuracy& accuracy, Report& report) {
  const Eigen::VectorXd scale = objective.space().tangent_scale();
  const double cost = objective.evaluate(x);
  report.expect(std::abs(cost - model.cost) <= accuracy.cost * std::abs(cost) + 1e-300,
                "cost: evaluate says ", cost, ", normal_equations ", model.cost);

  Eigen::VectorXd difference(scale.size());
  for (Eigen::Index i = 0; i < scale.size(); ++i) {
    const Eigen::VectorXd step =
        accuracy.relative_step * scale[i] * Eigen::VectorXd::Unit(scale.size(), i);
    difference[i] = (objective.evaluate(objective.space().plus(x, step)) -
                     objective.evaluate(objective.space().plus(x, -step))) /
                    (2.0 * accuracy.relative_step);
  }
  const Eigen::MatrixXd hessian = scale.asDiagonal() * model.hessian * scale.asDiagonal();
  const Eigen::VectorXd gradient = scale.cwiseProduct(model.gradient);
  const double size = gradient.norm() + 1e-3 * std::sqrt(2.0 * model.cost * hessian.trace());
  const double error = (gradient - difference).norm();
  report.expect(error <= accuracy.gradient * size, "gradient: off differences by ", error / size,
                " of its size, allowed ", accuracy.gradient);

  report.expect((hessian - hessian.transpose()).norm() <= 1e-12 * hessian.norm(),
                "the Hessian is not symmetric");
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(hessian);
  const double largest = std::max(eigen.eigenvalues().maxCoeff(), 1e-300);
  report.expect(eigen.eigenvalues().minCoeff() >= -1e-9 * largest,
                "the Hessian has a negative eigenvalue: ", eigen.eigenvalues().minCoeff());
  if (!accuracy.gauss_newton) return;
  const Eigen::VectorXd turned = eigen.eigenvectors().transpose() * gradient;
  const Eigen::VectorXd floored = eigen.eigenvalues().cwiseMax(1e-9 * largest);
  const double promised = 0.5 * turned.cwiseAbs2().cwiseQuotient(floored).sum();
  report.expect(promised <= model.cost * (1.0 + 1e-6), "the model promises a decrease of ",
                promised, " from a cost of ", model.cost);
}

}  // namespace

std::string optimizer_contract_violations(const OptimizerMaker& make,
                                          const OptimizerAccuracy& accuracy) {
  OptimizerOptions options;
  options.max_iterations = 200;
  options.max_evaluations = accuracy.evaluations;
  options.step_tolerance = 1e-7;
  options.cost_tolerance = 1e-14;
  options.seed = 5;
  Report report;
  check_accuracy(make, options, accuracy, report);
  check_bounds(make, options, accuracy, report);
  options.max_evaluations = 2000;
  check_threads(make, options, report);
  check_cancellation(make, options, report);
  check_infinite_regions(make, options, report);
  return report.text();
}

std::string objective_contract_violations(const Objective& objective,
                                          std::span<const Eigen::VectorXd> points,
                                          const ObjectiveAccuracy& accuracy) {
  Report report;
  std::vector<NormalEquations> models(points.size());
  std::vector<double> costs(points.size()), batch(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    costs[i] = objective.evaluate(points[i]);
    report.expect(costs[i] >= 0.0, "point ", i, ": the cost is ", costs[i]);
    const bool usable = objective.normal_equations(points[i], models[i]);
    report.expect(usable == std::isfinite(costs[i]), "point ", i,
                  ": evaluate and normal_equations disagree whether it can be evaluated");
    if (usable) check_model(objective, points[i], models[i], accuracy, report);
  }
  objective.evaluate_batch(points, batch);
  report.expect(batch == costs, "evaluate_batch differs from evaluate");

  constexpr std::size_t repeats = 4;
  std::vector<char> same(repeats * points.size(), 0);
  parallel_for(same.size(), [&](std::size_t k) {
    const std::size_t i = k % points.size();
    NormalEquations model;
    const bool usable = objective.normal_equations(points[i], model);
    same[k] = objective.evaluate(points[i]) == costs[i] && usable == std::isfinite(costs[i]) &&
              (!usable || (model.cost == models[i].cost && model.gradient == models[i].gradient &&
                           model.hessian == models[i].hessian));
  });
  for (const char equal : same) {
    report.expect(equal != 0, "calls from several threads give other numbers than single ones");
  }
  return report.text();
}

}  // namespace semblance
