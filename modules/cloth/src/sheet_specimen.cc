#include "semblance/cloth/sheet_specimen.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

namespace semblance {
namespace {

/// Positions of the vertices at (u, v) for a deformation.
using Shape = std::function<Eigen::Vector3d(double u, double v, double deformation)>;

/// A sheet that is led through shapes.
class LedSheet {
 public:
  LedSheet(Sheet sheet, const std::vector<bool>& clamped, const Fabric& fabric,
           const SheetModel& model, double area_m2, Shape shape)
      : sheet_(std::move(sheet)),
        energy_(sheet_, fabric, model, clamped),
        area_m2_(area_m2),
        shape_(std::move(shape)),
        positions_m_(positions(0.0)),
        memory_(energy_.memory_at(positions_m_)) {}

  double force(double deformation) {
    // Small against the deformations of tests, large against rounding.
    const double h = 1e-6 * std::max(1.0, std::abs(deformation));
    const Points motion = (positions(deformation + h) - positions(deformation - h)) / (2.0 * h);
    energy_.begin_step(positions_m_, memory_, std::numeric_limits<double>::infinity());
    positions_m_ = positions(deformation);
    Points gradient;
    energy_.gradient(positions_m_, gradient);
    energy_.end_step(positions_m_, memory_);
    return gradient.cwiseProduct(motion).sum() / area_m2_;
  }

 private:
  Points positions(double deformation) const {
    Points x(sheet_.vertex_count(), 3);
    for (Eigen::Index i = 0; i < x.rows(); ++i) {
      x.row(i) = shape_(sheet_.material_m(i, 0), sheet_.material_m(i, 1), deformation);
    }
    return x;
  }

  Sheet sheet_;
  SheetEnergy energy_;
  double area_m2_;
  Shape shape_;
  Points positions_m_;
  SheetMemory memory_;
};

Specimen led(std::shared_ptr<LedSheet> sheet) {
  return [sheet](double deformation) { return sheet->force(deformation); };
}

/// Puts the tested direction first.
Shape along(Direction direction, const Shape& shape) {
  if (direction == warp) return shape;
  return [shape](double u, double v, double deformation) { return shape(v, u, deformation); };
}

constexpr double side_m = 0.05, spacing_m = 0.01;

Specimen homogeneous(const Fabric& fabric, const SheetModel& model, const Shape& shape) {
  return led(std::make_shared<LedSheet>(make_rectangle(side_m, side_m, spacing_m),
                                        std::vector<bool>{}, fabric, model, side_m * side_m,
                                        shape));
}

Specimen pulled(const Fabric& fabric, const SheetModel& model, Direction direction) {
  return homogeneous(fabric, model, along(direction, [](double u, double v, double strain) {
                       return Eigen::Vector3d(u * (1.0 + strain), v, 0.0);
                     }));
}

Specimen sheared(const Fabric& fabric, const SheetModel& model) {
  return homogeneous(fabric, model, [](double u, double v, double angle) {
    return Eigen::Vector3d(u + v * std::sin(angle), v * std::cos(angle), 0.0);
  });
}

/// 1 cm between straight clamps, as in the real test. Spacings keep their length, and each turns as
/// the arc does at its middle.
Specimen bent(const Fabric& fabric, const SheetModel& model, Direction direction) {
  constexpr double length = 0.01, width = 0.002, spacing = 0.0005;
  const double whole = length + 2.0 * spacing;
  Sheet sheet = direction == warp ? make_rectangle(whole, width, spacing)
                                  : make_rectangle(width, whole, spacing);
  std::vector<bool> clamped(sheet.vertex_count());
  for (Eigen::Index i = 0; i < sheet.vertex_count(); ++i) {
    const double s = sheet.material_m(i, direction);
    clamped[i] = s < 1.5 * spacing || s > whole - 1.5 * spacing;
  }
  const Shape arc = [=](double s, double t, double curvature) {
    Eigen::Vector3d at(0.0, t, 0.0);
    for (double middle = 0.5 * spacing; middle < s; middle += spacing) {
      const double from_clamp = std::clamp(middle - spacing, 0.0, length);
      const double angle = curvature * (from_clamp - 0.5 * length);
      at += spacing * Eigen::Vector3d(std::cos(angle), 0.0, std::sin(angle));
    }
    return at;
  };
  return led(std::make_shared<LedSheet>(std::move(sheet), clamped, fabric, model, length * width,
                                        along(direction, arc)));
}

}  // namespace

Specimens sheet_specimens(const Fabric& fabric, const SheetModel& model) {
  return {{pulled(fabric, model, warp), pulled(fabric, model, weft)},
          {bent(fabric, model, warp), bent(fabric, model, weft)},
          sheared(fabric, model)};
}

}  // namespace semblance
