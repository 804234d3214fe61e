#include "semblance/cloth/sheet_energy.h"

#include <gmock/gmock.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "semblance/cloth/assembly.h"
#include "sheets.h"

namespace semblance {
namespace {

struct Case {
  const char* name;
  bool quads;
  SheetModel model;
};

SheetModel model_of(BendingModel bending, CompressionLaw compression) {
  SheetModel model;
  model.bending = bending;
  model.compression = compression;
  return model;
}

/// A lossy, curved, anisotropic fabric, so that no term of the energy is trivial.
Fabric rough_fabric() {
  Fabric fabric = linear_fabric();
  const Curve stiffening({0.0, 0.02, 0.05}, {0.0, 50.0, 400.0});
  for (int k : {0, 1}) {
    fabric.tension[k].elastic = stiffening;
    fabric.tension[k].friction = Curve::linear(300.0, 0.05);
    fabric.tension[k].reversal = 1e-3;
  }
  fabric.tension[1].viscosity_s = 2e-3;
  fabric.shear = linear_response(60.0, 0.14, 1.0);
  fabric.shear.reversal = 0.01;
  fabric.bending[0] = linear_response(2e-5, 250.0, 4e-4);
  fabric.bending[1] = linear_response(1e-5, 250.0, 2e-4);
  for (int k : {0, 1}) {
    fabric.bending[k].reversal = 5.0;
    fabric.bending[k].viscosity_s = 1e-3;
  }
  return fabric;
}

class SheetEnergies : public testing::TestWithParam<Case> {
 protected:
  SheetEnergies()
      : sheet_(GetParam().quads ? make_rectangle(0.08, 0.06, 0.01) : make_disc(0.05, 0.01)),
        energy_(sheet_, rough_fabric(), GetParam().model, {}) {}

  BlockMatrix matrix(const Points& x, HessianKind kind) {
    Points gradient;
    StrainHessian strains;
    energy_.hessian(x, kind, gradient, strains);
    assembly_ = std::make_unique<Assembly>(
        energy_.deformation(), static_cast<int>(sheet_.vertex_count()), std::vector<bool>{});
    BlockMatrix out;
    assembly_->assemble(strains, out);
    out.complete();
    return out;
  }

  Sheet sheet_;
  SheetEnergy energy_;
  std::unique_ptr<Assembly> assembly_;
};

INSTANTIATE_TEST_SUITE_P(
    Laws, SheetEnergies,
    testing::Values(
        Case{"Quads", true, {}}, Case{"Triangles", false, {}},
        Case{"QuadsAsTension", true, model_of(BendingModel::curvature, CompressionLaw::as_tension)},
        Case{"QuadsChoiKo", true, model_of(BendingModel::interlaced, CompressionLaw::none)},
        Case{"TrianglesChoiKo", false, model_of(BendingModel::interlaced, CompressionLaw::none)}),
    [](const auto& test) { return std::string(test.param.name); });

TEST_P(SheetEnergies, GradientIsTheDifferenceOfEnergies) {
  for (const double noise : {1e-5, 1e-3}) {
    const Points x = crumpled(sheet_, noise), d = random_points(x.rows(), 2);
    Points gradient;
    energy_.gradient(x, gradient);
    const double h = 1e-7;
    const double difference = (energy_.energy(x + h * d) - energy_.energy(x - h * d)) / (2.0 * h);
    EXPECT_NEAR(gradient.cwiseProduct(d).sum(), difference, 1e-5 * std::abs(difference)) << noise;
  }
}

TEST_P(SheetEnergies, GradientWithFrictionAndViscosityIsTheDifferenceOfEnergies) {
  const Points start = crumpled(sheet_, 1e-4, 3);
  const SheetMemory memory = energy_.memory_at(laid_flat(sheet_));
  energy_.begin_step(start, memory, 0.01);
  const Points x = start + 1e-4 * random_points(start.rows(), 4), d = random_points(x.rows(), 5);
  Points gradient;
  energy_.gradient(x, gradient);
  const double h = 1e-8;
  const double difference = (energy_.energy(x + h * d) - energy_.energy(x - h * d)) / (2.0 * h);
  EXPECT_NEAR(gradient.cwiseProduct(d).sum(), difference, 1e-4 * std::abs(difference));
}

TEST_P(SheetEnergies, MatrixIsTheDifferenceOfGradients) {
  for (const double noise : {1e-5, 1e-3}) {
    const Points x = crumpled(sheet_, noise), d = random_points(x.rows(), 2);
    const BlockMatrix a = matrix(x, HessianKind::exact);
    BlockVector v = BlockVector::Zero(4, x.rows()), product;
    v.topRows<3>() = d.transpose();
    a.multiply(v, product);
    Points plus, minus;
    const double h = 1e-8;
    energy_.gradient(x + h * d, plus);
    energy_.gradient(x - h * d, minus);
    const Points difference = (plus - minus) / (2.0 * h);
    const Points error = product.topRows<3>().transpose() - difference;
    EXPECT_LT(error.norm(), 1e-5 * difference.norm()) << noise;
  }
}

TEST_P(SheetEnergies, ConvexMatrixHasNoNegativeCurvature) {
  const Eigen::MatrixXd a = dense(matrix(crumpled(sheet_, 2e-3), HessianKind::convex));
  // Blocks are in single precision.
  EXPECT_LT((a - a.transpose()).norm(), 1e-6 * a.norm());
  const double lowest = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(a).eigenvalues()[0];
  EXPECT_GT(lowest, -1e-6 * a.norm());
}

TEST_P(SheetEnergies, NearlyExactMatrixIsFourFifthsOfTheWayFromConvexToExact) {
  const Points x = crumpled(sheet_, 2e-3);
  const Eigen::MatrixXd convex = dense(matrix(x, HessianKind::convex)),
                        exact = dense(matrix(x, HessianKind::exact)),
                        nearly = dense(matrix(x, HessianKind::nearly_exact));
  EXPECT_GT((exact - convex).norm(), 1e-3 * exact.norm());
  EXPECT_LT((nearly - convex - 0.8 * (exact - convex)).norm(), 1e-6 * exact.norm());
}

/// A straight way that turns the sheet about an edge lengthens its yarns and should not.
TEST_P(SheetEnergies, YarnsResistWhatAStraightWayLengthensThem) {
  const Points from = laid_flat(sheet_);
  Points to = from;
  to.col(1) += 0.2 * from.col(0);  // longer by 2 %
  Points gradient;
  StrainHessian strains;
  energy_.hessian(from, HessianKind::convex, gradient, strains);
  energy_.resist_lengthening(from, to, gradient, strains);

  // All warp yarns are lengthened alike and so have the same stiffness.
  const auto squares = [&](const Points& x) {
    const std::vector<double> elongations = energy_.elongations(x);
    double sum = 0.0;
    for (std::size_t e = 0; e < elongations.size(); ++e)
      sum += energy_.deformation().area_m2(static_cast<int>(e)) * elongations[e] * elongations[e];
    return sum;
  };
  const double h = 1e-6;
  std::vector<double> stiffnesses;
  for (const int seed : {5, 6}) {
    Points d = random_points(to.rows(), seed);
    d.col(0).setZero(), d.col(2).setZero();  // from `from` on across the yarns: none is foreseen
    stiffnesses.push_back(gradient.cwiseProduct(d).sum() * 4.0 * h /
                          (squares(to + h * d) - squares(to - h * d)));
  }
  EXPECT_GT(stiffnesses[0], 0.0);
  EXPECT_NEAR(stiffnesses[0], stiffnesses[1], 1e-4 * stiffnesses[0]);

  const Assembly assembly(energy_.deformation(), static_cast<int>(to.rows()), {});
  BlockMatrix shrinking;
  assembly.assemble(strains, shrinking);
  // Holds the sheet against motions as a whole, which change no length.
  for (Symmetric3& own : shrinking.own) own[0] = own[3] = own[5] = 0.05;
  shrinking.complete();
  const Points down = -gradient;
  const Eigen::VectorXd change =
      dense(shrinking).ldlt().solve(Eigen::Map<const Eigen::VectorXd>(down.data(), down.size()));
  to += Eigen::Map<const Points>(change.data(), to.rows(), 3);
  for (const double elongation : energy_.elongations(to)) EXPECT_LT(std::abs(elongation), 0.002);
}

TEST_P(SheetEnergies, DoesNotChangeWhenTheSheetMovesAsAWhole) {
  const Points x = crumpled(sheet_, 1e-3);
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(1.1, Eigen::Vector3d(1.0, 2.0, -0.5).normalized()).toRotationMatrix();
  const Points moved = (x * turn.transpose()).rowwise() + Eigen::RowVector3d(0.3, -2.0, 1.0);
  const double energy = energy_.energy(x);
  EXPECT_NEAR(energy_.energy(moved), energy, 1e-9 * energy);
}

TEST_P(SheetEnergies, InnerForcesHaveNoSumAndNoTorque) {
  const Points x = crumpled(sheet_, 1e-3);
  Points gradient;
  energy_.gradient(x, gradient);
  Eigen::Vector3d torque = Eigen::Vector3d::Zero();
  for (Eigen::Index v = 0; v < x.rows(); ++v) {
    torque += Eigen::Vector3d(x.row(v)).cross(Eigen::Vector3d(gradient.row(v)));
  }
  EXPECT_LT(gradient.colwise().sum().norm(), 1e-10 * gradient.norm());
  EXPECT_LT(torque.norm(), 1e-9 * gradient.norm());
}

TEST_P(SheetEnergies, VanishesForAFlatSheet) {
  EXPECT_NEAR(energy_.energy(laid_flat(sheet_)), 0.0, 1e-15);
}

/// Any material direction of an isotropic fabric bends and stretches alike, on any mesh.
TEST(SheetEnergy, OfACylinderIsThatOfThePlate) {
  const double radius = 0.05, bending = 1e-4;
  for (const double angle : {0.0, 0.4, std::numbers::pi / 4.0}) {
    for (const bool quads : {true, false}) {
      const Sheet sheet = quads ? make_rectangle(0.1, 0.1, 0.002) : make_disc(0.05, 0.002);
      const SheetEnergy energy(sheet, linear_fabric(0.0, 0.0, bending), {}, {});
      Points x(sheet.vertex_count(), 3);
      for (Eigen::Index i = 0; i < x.rows(); ++i) {
        const double u = sheet.material_m(i, 0), v = sheet.material_m(i, 1);
        const double s = std::cos(angle) * u + std::sin(angle) * v;
        const double t = -std::sin(angle) * u + std::cos(angle) * v;
        x.row(i) << radius * std::sin(s / radius), radius * std::cos(s / radius), t;
      }
      const double plate = 0.5 * bending / (radius * radius) * sheet.vertex_areas_m2().sum();
      // Borders bend less: their outer half spacing carries no moment.
      EXPECT_NEAR(energy.energy(x), plate, 0.05 * plate) << angle << quads;
    }
  }
}

}  // namespace
}  // namespace semblance
