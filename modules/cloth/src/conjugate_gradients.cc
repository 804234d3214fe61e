#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "column_chunks.h"
#include "preconditioners.h"
#include "semblance/cloth/linear_solver.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

constexpr int most_iterations = 2000;

double dot(const BlockVector& a, const BlockVector& b) {
  return sum_over_columns(a.cols(), [&](Eigen::Index first, Eigen::Index n) {
    return a.middleCols(first, n).cwiseProduct(b.middleCols(first, n)).sum();
  });
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
        turn(next_rho / rho);
      }
      rho = next_rho;
      matrix_->multiply(p_, q_);
      const double curvature = dot(p_, q_);
      if (!(curvature > 0.0) || !(rho > 0.0)) {
        out.negative_curvature = true;
        break;
      }
      const double alpha = rho / curvature;
      residual = std::sqrt(advance(alpha, x));
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
  /// The next direction: z + beta p.
  void turn(double beta) {
    for_column_chunks(p_.cols(), [&](std::size_t, Eigen::Index first, Eigen::Index n) {
      p_.middleCols(first, n) = z_.middleCols(first, n) + beta * p_.middleCols(first, n);
    });
  }

  /// Goes along p; the square of the residual's norm there.
  double advance(double alpha, BlockVector& x) {
    return sum_over_columns(x.cols(), [&](Eigen::Index first, Eigen::Index n) {
      x.middleCols(first, n) += alpha * p_.middleCols(first, n);
      r_.middleCols(first, n) -= alpha * q_.middleCols(first, n);
      return r_.middleCols(first, n).squaredNorm();
    });
  }

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
  if (name == "two-level" && sheet.grid) {
    return std::make_unique<ConjugateGradients>(
        make_two_level(make_lines(*sheet.grid), *sheet.grid));
  }
  throw InvalidInput("no linear solver '" + name + "' for this sheet");
}

}  // namespace semblance
