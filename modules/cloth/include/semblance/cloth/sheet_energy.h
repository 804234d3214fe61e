// The elastic energy of a sheet of fabric, its internal friction and viscosity.
#pragma once

#include <array>
#include <functional>
#include <initializer_list>
#include <vector>

#include "semblance/cloth/deformation.h"
#include "semblance/cloth/fabric.h"
#include "semblance/cloth/response.h"

namespace semblance {

/// How friction between the fabric's yarns acts.
enum class InternalFriction {
  none,
  /// Step by step, by the sliders of ModeResponse: loops are followed as they are gone through.
  incremental,
  /// As if every deformation had only grown since the sheet lay flat: the measured loading curves
  /// in place of the elastic ones, which is elastic, so a rest shape depends on no path.
  monotone,
};

/// Which laws a sheet follows.
struct SheetModel {
  BendingModel bending = BendingModel::curvature;
  CompressionLaw compression = CompressionLaw::buckling;
  InternalFriction internal_friction = InternalFriction::incremental;
  /// Wrinkles shorter than this are left to the law of compression, whose load is Euler's for it:
  /// B (2 pi / wavelength)^2.
  double buckling_wavelength_m = 0.02;
};

/// Second derivatives of the energy in the rows of a Deformation: the symmetric 3x3 of each row as
/// xx, xy, xz, yy, yz, zz (two numbers of padding), and for each pair of shear rows the 3x3 that
/// mixes them, by columns (three of padding).
struct StrainHessian {
  std::vector<std::array<float, 8>> rows;
  std::vector<std::array<float, 12>> shear;
};

/// Which Hessian: the true one; one without the curvature of lengths and angles where that can be
/// negative, and so without negative curvature; or that with most of it, which seldom has any.
enum class HessianKind { exact, convex, nearly_exact };

/// What a sheet remembers from step to step, per row of its Deformation (shear: per pair, at the
/// first row): where each slider is anchored and how large the deformation was.
struct SheetMemory {
  std::vector<double> anchor;
  std::vector<double> previous;
};

/// Energy as a function of the vertices' positions. Elastic terms depend on positions alone;
/// friction and viscosity are potentials over one step (Dissipation), set up by begin_step.
/// Evaluations are const and may run on several threads inside; results do not depend on how many.
class SheetEnergy {
 public:
  /// `fixed`: one flag per vertex that a clamp holds, or empty.
  SheetEnergy(const Sheet& sheet, Fabric fabric, const SheetModel& model,
              const std::vector<bool>& fixed);

  const Deformation& deformation() const { return deformation_; }
  const Fabric& fabric() const { return fabric_; }
  const SheetModel& model() const { return model_; }

  /// The memory of a sheet that was brought to `positions_m` without friction.
  SheetMemory memory_at(const Points& positions_m);
  /// Friction and viscosity from here on are those of a step of `step_s` that starts at
  /// `positions_m`; an infinite step has no viscosity.
  void begin_step(const Points& positions_m, const SheetMemory& memory, double step_s);
  /// Without friction and viscosity.
  void begin_elastic();
  /// The memory after the step ended at `positions_m`.
  void end_step(const Points& positions_m, SheetMemory& memory) const;

  /// Joule.
  double energy(const Points& positions_m) const;
  /// Energy; `gradient` (N, one row per vertex) is set.
  double gradient(const Points& positions_m, Points& gradient) const;
  /// Energy, gradient and second derivatives in the rows.
  double hessian(const Points& positions_m, HessianKind kind, Points& gradient,
                 StrainHessian& hessian) const;

  /// Turning yarns lengthens them on a straight way from `from` to `to`, by more than their strains
  /// at `from` and the derivatives there foresaw. Sets `gradient` to that of the energy by which
  /// they would shrink to the lengths foreseen, and `hessian`'s rows of tension to its second
  /// derivatives; the other rows stay.
  void resist_lengthening(const Points& from, const Points& to, Points& gradient,
                          StrainHessian& hessian) const;

  /// Elongation |d| - 1 of every warp and weft row, in the order of the rows.
  std::vector<double> elongations(const Points& positions_m) const;

 private:
  struct RowSlots;
  double evaluate(const Points& positions_m, HessianKind kind, Points* gradient,
                  StrainHessian* hessian) const;
  double evaluate_row(const Points& positions_m, StrainKind strain, int e, RowSlots& slots) const;
  double evaluate_shear(const Points& positions_m, int pair, RowSlots& slots) const;
  void gather_gradient(const RowSlots& slots, Points& gradient) const;
  void set_normals(const Points& positions_m);
  /// On several threads.
  void each_row(std::initializer_list<StrainKind> kinds,
                const std::function<void(StrainKind, int)>& body) const;
  void each_lossy_row(const std::function<void(StrainKind, int)>& body) const;
  const ModeResponse& response(StrainKind kind) const;
  LawPoint length_law(StrainKind kind, int e, double length) const;
  /// The deformation that friction and viscosity act on.
  double scalar_strain(const Points& positions_m, StrainKind kind, int e) const;

  Fabric fabric_;
  SheetModel model_;
  Deformation deformation_;
  Triangles triangles_;
  ModeResponse twist_;
  std::array<double, 2> buckling_load_n_m_{};
  // The gather form of D: for each vertex the rows it takes part in.
  std::vector<int> vertex_begin_;
  std::vector<StrainEntry> vertex_rows_;
  std::vector<Dissipation> dissipation_;  // per row, empty without
  std::vector<Eigen::Vector3d> normal_;   // per row, bending only, when there is dissipation
};

}  // namespace semblance
