#include "semblance/cloth/block_matrix.h"

#include <gmock/gmock.h>

#include <Eigen/Cholesky>
#include <Eigen/Dense>

#include "preconditioners.h"
#include "semblance/cloth/linear_solver.h"
#include "sheets.h"

namespace semblance {
namespace {

/// The matrix of a curved sheet in a step, with two vertices held and two contacts: one between
/// neighbours, one between parts that have nothing to do with each other.
class SystemMatrix : public testing::Test {
 protected:
  SystemMatrix() {
    fixed_.assign(sheet_.vertex_count(), false);
    fixed_[0] = fixed_[6] = true;
    const SheetEnergy energy(sheet_, linear_fabric(), {}, fixed_);
    assembly_ = std::make_unique<Assembly>(energy.deformation(),
                                           static_cast<int>(sheet_.vertex_count()), fixed_);
    Points gradient;
    StrainHessian strains;
    energy.hessian(crumpled(sheet_, 1e-4), HessianKind::convex, gradient, strains);
    assembly_->assemble(strains, matrix_);
    for (auto& own : matrix_.own) own[0] = own[3] = own[5] = 0.05f;
    plain_ = matrix_;
    stiffness_ = Eigen::Vector3d(1.0, 2.0, -1.0) * Eigen::RowVector3d(1.0, 2.0, -1.0);
    matrix_.add({1, 2, 8, -1}, {0.5, 0.3, 0.2, 0.0}, 40.0 * stiffness_);
    matrix_.add({10, 40, 41, 47}, {1.0, -0.2, -0.3, -0.5}, stiffness_);
    matrix_.complete();
    plain_.complete();
  }

  Sheet sheet_ = make_rectangle(0.06, 0.07, 0.01);
  std::vector<bool> fixed_;
  std::unique_ptr<Assembly> assembly_;
  Eigen::Matrix3d stiffness_;
  BlockMatrix matrix_, plain_;
};

TEST_F(SystemMatrix, ContactsAddTheirStiffness) {
  Eigen::MatrixXd expected = dense(plain_);
  const auto add = [&](std::vector<int> v, std::vector<double> w, double scale) {
    for (std::size_t i = 0; i < v.size(); ++i) {
      for (std::size_t j = 0; j < v.size(); ++j) {
        expected.block<3, 3>(3 * v[i], 3 * v[j]) += scale * w[i] * w[j] * stiffness_;
      }
    }
  };
  add({1, 2, 8}, {0.5, 0.3, 0.2}, 40.0);
  add({10, 40, 41, 47}, {1.0, -0.2, -0.3, -0.5}, 1.0);
  EXPECT_LT((dense(matrix_) - expected).norm(), 1e-6 * expected.norm());
}

/// Nothing of a stiff contact is left in a motion of all its vertices together, whatever its
/// weights round to: the least negative stiffness there would stop conjugate gradients.
TEST_F(SystemMatrix, StiffContactsDoNotResistCommonMotion) {
  BlockMatrix contact = plain_, alone = plain_;
  contact.add({10, 40, 41, 47}, {1.0, -0.2, -0.3, -0.5}, 1e8 * stiffness_);
  BlockVector together = BlockVector::Zero(4, sheet_.vertex_count()), with, without;
  for (const int v : {10, 40, 41, 47}) together.col(v) << 1.0, 1.0, -1.0, 0.0;
  contact.multiply(together, with);
  alone.multiply(together, without);
  EXPECT_LT((with - without).cwiseAbs().maxCoeff(), 1e-5);
}

TEST_F(SystemMatrix, FixedVerticesStandAlone) {
  const Eigen::MatrixXd a = dense(matrix_);
  for (int k = 0; k < 3; ++k) {
    Eigen::VectorXd unit = Eigen::VectorXd::Zero(a.rows());
    unit[18 + k] = 1.0;
    EXPECT_EQ(Eigen::VectorXd(a.row(18 + k)), unit);
  }
}

TEST_F(SystemMatrix, SolversAgreeWithADenseFactorisation) {
  const int n = static_cast<int>(sheet_.vertex_count());
  BlockVector b = BlockVector::Zero(4, n);
  b.topRows<3>() = random_points(n, 7).transpose();
  for (const int f : {0, 6}) b.col(f).setZero();
  Eigen::MatrixXd a = dense(matrix_);
  for (const int f : {0, 6})
    a.middleCols(3 * f, 3).setZero(), a.middleCols(3 * f, 3).middleRows(3 * f, 3).setIdentity();
  const Eigen::MatrixXd right = b.topRows<3>();
  const Eigen::VectorXd exact =
      a.ldlt().solve(Eigen::Map<const Eigen::VectorXd>(right.data(), 3 * n));
  for (const char* name : {"jacobi", "lines", "two-level", "direct"}) {
    const auto solver = make_linear_solver(name, sheet_);
    solver->prepare(matrix_);
    BlockVector x = BlockVector::Zero(4, n);
    solver->solve(b, 1e-9, x);
    const Eigen::MatrixXd found = x.topRows<3>();
    const Eigen::Map<const Eigen::VectorXd> flat(found.data(), 3 * n);
    EXPECT_LT((flat - exact).norm(), 1e-3 * exact.norm()) << name;
  }
}

TEST_F(SystemMatrix, LinesNeedFarFewerIterations) {
  const int n = static_cast<int>(sheet_.vertex_count());
  BlockVector b = BlockVector::Zero(4, n);
  b.topRows<3>() = random_points(n, 7).transpose();
  for (const int f : {0, 6}) b.col(f).setZero();
  int iterations[2];
  for (const int k : {0, 1}) {
    const auto solver = make_linear_solver(k == 0 ? "jacobi" : "lines", sheet_);
    solver->prepare(matrix_);
    BlockVector x = BlockVector::Zero(4, n);
    iterations[k] = solver->solve(b, 1e-3, x).iterations;
  }
  EXPECT_LT(4 * iterations[1], iterations[0]);
}

/// A sheet of some coarse cells, with contacts within a cell, between neighbours, and across it
/// all.
class CoarseGrid : public testing::Test {
 protected:
  CoarseGrid() {
    const SheetEnergy energy(sheet_, linear_fabric(), {}, {});
    assembly_ = std::make_unique<Assembly>(
        energy.deformation(), static_cast<int>(sheet_.vertex_count()), std::vector<bool>{});
    Points gradient;
    StrainHessian strains;
    energy.hessian(crumpled(sheet_, 1e-4), HessianKind::convex, gradient, strains);
    assembly_->assemble(strains, matrix_);
    for (auto& own : matrix_.own) own[0] = own[3] = own[5] = 1e-3;
    const Eigen::Matrix3d k = Eigen::Vector3d(1.0, 2.0, -1.0) * Eigen::RowVector3d(1.0, 2.0, -1.0);
    const auto at = [&](int i, int j) { return sheet_.grid->vertex(i, j); };
    matrix_.add({at(1, 1), at(2, 1), at(2, 2), -1}, {0.5, 0.3, 0.2, 0.0}, 40.0 * k);
    matrix_.add({at(6, 9), at(7, 9), at(9, 9), at(9, 10)}, {0.4, 0.6, -0.3, -0.7}, 2.0 * k);
    matrix_.add({at(0, 0), at(24, 33), at(25, 33), at(25, 34)}, {1.0, -0.2, -0.3, -0.5}, k);
    matrix_.complete();
  }

  Sheet sheet_ = make_rectangle(0.25, 0.34, 0.01);
  std::unique_ptr<Assembly> assembly_;
  BlockMatrix matrix_;
};

/// In functions that are linear along warp and weft, which bilinear ones hold, P (P'AP)^-1 P' is
/// the inverse of A.
TEST_F(CoarseGrid, SolvesWhatItsFunctionsSpan) {
  class Nothing : public Preconditioner {
    void prepare(const BlockMatrix&) override {}
    void apply(const BlockVector& r, BlockVector& z) override { z.setZero(4, r.cols()); }
  };
  // Inertia, for a condition number that leaves digits to compare.
  for (auto& own : matrix_.own) own[0] = own[3] = own[5] = 1.0;
  matrix_.complete();
  const auto coarse = make_two_level(std::make_unique<Nothing>(), *sheet_.grid);
  coarse->prepare(matrix_);
  BlockVector linear = BlockVector::Zero(4, sheet_.vertex_count()), load, found;
  for (int j = 0; j < sheet_.grid->rows; ++j) {
    for (int i = 0; i < sheet_.grid->columns; ++i) {
      linear.col(sheet_.grid->vertex(i, j)) << 0.3 - 0.02 * i + 0.01 * j, 0.05 * i + 0.02 * j,
          -0.1 + 0.03 * j, 0.0;
    }
  }
  matrix_.multiply(linear, load);
  coarse->apply(load, found);
  EXPECT_LT((found - linear).norm(), 1e-6 * linear.norm());
}

/// A load that is all long waves; without the coarse grid they travel line by line.
TEST_F(CoarseGrid, TakesLongWaves) {
  BlockVector b = BlockVector::Zero(4, sheet_.vertex_count());
  for (int j = 0; j < sheet_.grid->rows; ++j) {
    for (int i = 0; i < sheet_.grid->columns; ++i)
      b(2, sheet_.grid->vertex(i, j)) = std::cos(0.1 * i) - std::cos(0.09 * j);
  }
  int iterations[2];
  for (const int k : {0, 1}) {
    const auto solver = make_linear_solver(k == 0 ? "lines" : "two-level", sheet_);
    solver->prepare(matrix_);
    BlockVector x = BlockVector::Zero(4, sheet_.vertex_count());
    iterations[k] = solver->solve(b, 1e-6, x).iterations;
  }
  EXPECT_LT(2 * iterations[1], iterations[0]);
}

/// One factorisation after another of the same places, then with one coupling less.
TEST_F(SystemMatrix, DirectNeedsAtMostThreeIterations) {
  const int n = static_cast<int>(sheet_.vertex_count());
  BlockVector b = BlockVector::Zero(4, n);
  b.topRows<3>() = random_points(n, 7).transpose();
  for (const int f : {0, 6}) b.col(f).setZero();
  const auto solver = make_linear_solver("direct", sheet_);
  for (const BlockMatrix* matrix : {&matrix_, &matrix_, &plain_}) {
    solver->prepare(*matrix);
    BlockVector x = BlockVector::Zero(4, n), product;
    EXPECT_LE(solver->solve(b, 1e-6, x).iterations, 3);
    matrix->multiply(x, product);
    EXPECT_LT((product - b).norm(), 1e-5 * b.norm());
  }
}

}  // namespace
}  // namespace semblance
