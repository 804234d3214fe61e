#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "preconditioners.h"
#include "semblance/cloth/linear_solver.h"
#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"

namespace semblance {
namespace {

constexpr int chunk_columns = 4096;
constexpr int most_iterations = 2000;

/// Sum over chunks in order, so the same for every number of threads.
double dot(const BlockVector& a, const BlockVector& b) {
  const Eigen::Index columns = a.cols(), chunks = (columns + chunk_columns - 1) / chunk_columns;
  double sum = 0.0;
  for (Eigen::Index c = 0; c < chunks; ++c) {
    const Eigen::Index first = c * chunk_columns,
                       n = std::min<Eigen::Index>(chunk_columns, columns - first);
    sum += a.middleCols(first, n).cwiseProduct(b.middleCols(first, n)).sum();
  }
  return sum;
}

class ConjugateGradients : public LinearSolver {
 public:
  explicit ConjugateGradients(std::unique_ptr<Preconditioner> preconditioner)
      : preconditioner_(std::move(preconditioner)) {}

  void prepare(const BlockMatrix& matrix) override {
    matrix_ = &matrix;
    preconditioner_->prepare(matrix);
  }

  LinearSolution solve(const BlockVector& b, double tolerance, BlockVector& x) override {
    LinearSolution out;
    const double goal = tolerance * std::sqrt(dot(b, b));
    matrix_->multiply(x, q_);
    r_ = b - q_;
    double residual = std::sqrt(dot(r_, r_));
    double rho = 0.0, model = 0.0;
    while (residual > 1e-6 * goal / tolerance && out.iterations < most_iterations) {
      preconditioner_->apply(r_, z_);
      const double next_rho = dot(r_, z_);
      if (out.iterations == 0) {
        p_ = z_;
      } else {
        p_ = z_ + (next_rho / rho) * p_;
      }
      rho = next_rho;
      matrix_->multiply(p_, q_);
      const double curvature = dot(p_, q_);
      if (!(curvature > 0.0) || !(rho > 0.0)) {
        out.negative_curvature = true;
        break;
      }
      const double alpha = rho / curvature;
      x += alpha * p_;
      r_ -= alpha * q_;
      residual = std::sqrt(dot(r_, r_));
      ++out.iterations;
      // Nash and Sofer (1990): by what the model of the energy still gains, since the residual's
      // norm hears only stiff modes.
      const double gain = 0.5 * rho * rho / curvature;
      model += gain;
      if (out.iterations * gain <= tolerance * model) break;
    }
    out.relative_residual = goal > 0.0 ? residual / goal * tolerance : 0.0;
    return out;
  }

 private:
  std::unique_ptr<Preconditioner> preconditioner_;
  const BlockMatrix* matrix_ = nullptr;
  BlockVector r_, z_, p_, q_;
};

/// The inverses of the diagonal blocks.
class Jacobi : public Preconditioner {
 public:
  void prepare(const BlockMatrix& matrix) override {
    const BlockPattern& pattern = *matrix.pattern;
    inverse_.resize(pattern.row_count());
    for (int r = 0; r < pattern.row_count(); ++r) {
      const auto& d = matrix.diagonal[r];
      Eigen::Matrix3d block;
      block << d[0], d[1], d[2], d[1], d[3], d[4], d[2], d[4], d[5];
      inverse_[r] = block.inverse();
    }
  }
  void apply(const BlockVector& r, BlockVector& z) override {
    z.resize(4, r.cols());
    for (Eigen::Index i = 0; i < r.cols(); ++i) {
      z.col(i).head<3>() = inverse_[i] * r.col(i).head<3>();
      z(3, i) = 0.0;
    }
  }

 private:
  std::vector<Eigen::Matrix3d> inverse_;
};

}  // namespace

std::unique_ptr<Preconditioner> make_jacobi() { return std::make_unique<Jacobi>(); }

std::unique_ptr<LinearSolver> make_linear_solver(const std::string& name, const Sheet& sheet) {
  if (name == "jacobi") return std::make_unique<ConjugateGradients>(make_jacobi());
  if (name == "direct") return std::make_unique<ConjugateGradients>(make_factorization());
  if (name == "lines" && sheet.grid) {
    return std::make_unique<ConjugateGradients>(make_lines(*sheet.grid));
  }
  throw InvalidInput("no linear solver '" + name + "' for this sheet");
}

}  // namespace semblance
