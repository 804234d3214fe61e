// Kawabata's figures of a fabric (KES-F), their units, and the fabric that they describe.
//
// S. Kawabata, The Standardization and Analysis of Hand Evaluation, 2nd edition, Osaka 1980:
//
//     tension  pulled to 500 gf/cm and back: EMT the strain there; WT the work up to it and WT' the
//              work given back; LT = WT / (500 gf/cm EMT / 2); RT = WT' / WT
//     shear    to +-8 deg: G the mean slope from 0.5 to 2.5 deg; 2HG and 2HG5 the loop's width at
//              0.5 and 5 deg
//     bending  to +-2.5 1/cm: B the mean slope from 0.5 to 1.5 1/cm; 2HB the loop's width at 1 1/cm
#pragma once

#include <array>
#include <numbers>
#include <optional>
#include <string>

#include "semblance/cloth/fabric.h"

namespace semblance {

/// SI from the units of KES: the only statement of these conversions.
namespace kes {
constexpr double n_from_gf = 9.80665e-3;
constexpr double rad_from_deg = std::numbers::pi / 180.0;
constexpr double strain_from_pct = 1e-2;
constexpr double per_m_from_per_cm = 1e2;
/// Force per width.
constexpr double n_m_from_gf_cm = n_from_gf / 1e-2;
/// Moment per width, gf cm/cm.
constexpr double n_from_gf_cm_cm = n_from_gf;
/// Work per area, gf cm/cm2.
constexpr double j_m2_from_gf_cm_cm2 = n_from_gf * 1e-2 / 1e-4;
/// Shear stiffness, gf/(cm deg).
constexpr double n_m_rad_from_gf_cm_deg = n_m_from_gf_cm / rad_from_deg;
/// Bending rigidity, gf cm2/cm.
constexpr double n_m_from_gf_cm2_cm = n_from_gf_cm_cm / per_m_from_per_cm;
constexpr double m_from_mm = 1e-3;
constexpr double kg_m2_from_g_m2 = 1e-3;

/// How far the tests go.
constexpr double tension_end_n_m = 500.0 * n_m_from_gf_cm;
constexpr double shear_end_rad = 8.0 * rad_from_deg;
constexpr double bending_end_1_m = 2.5 * per_m_from_per_cm;
}  // namespace kes

/// The figures, in their own units, as far as they are known.
struct KesFigures {
  using Figure = std::optional<double>;
  struct Tension {
    Figure emt_pct, lt, wt_gf_cm_cm2, rt_pct;
  };
  struct Shear {
    Figure g_gf_cm_deg, hg2_gf_cm, hg5_gf_cm;
  };
  struct Bending {
    Figure b_gf_cm2_cm, hb2_gf_cm_cm;
  };

  std::string name, source;
  std::array<Tension, 2> tension;  ///< by Direction
  Shear shear;
  std::array<Bending, 2> bending;  ///< by Direction
  Figure thickness_mm, weight_g_m2, drape_coefficient_pct;
  /// The source gives one figure for both directions; warp and weft hold it twice.
  bool mean_of_directions = false;
};

/// What a figure is called.
struct FigureName {
  const char* symbol;     ///< Kawabata's
  const char* unit;       ///< "" for a ratio
  const char* column;     ///< in files of figures
  const char* direction;  ///< "warp", "weft", or "" where there is but one
};

/// Calls visit(FigureName, figure) for each figure, in the order of tables and files.
template <class Figures, class Visit>
void for_each_figure(Figures& figures, const Visit& visit) {
  constexpr const char* direction[] = {"warp", "weft"};
  for (const int d : {warp, weft}) {
    auto& tension = figures.tension[static_cast<std::size_t>(d)];
    visit(FigureName{"EMT", "%", "EMT_pct", direction[d]}, tension.emt_pct);
    visit(FigureName{"LT", "", "LT", direction[d]}, tension.lt);
    visit(FigureName{"WT", "gf cm/cm2", "WT_gfcm_cm2", direction[d]}, tension.wt_gf_cm_cm2);
    visit(FigureName{"RT", "%", "RT_pct", direction[d]}, tension.rt_pct);
  }
  visit(FigureName{"G", "gf/(cm deg)", "G_gf_cm_deg", ""}, figures.shear.g_gf_cm_deg);
  visit(FigureName{"2HG", "gf/cm", "2HG_gf_cm", ""}, figures.shear.hg2_gf_cm);
  visit(FigureName{"2HG5", "gf/cm", "2HG5_gf_cm", ""}, figures.shear.hg5_gf_cm);
  for (const int d : {warp, weft}) {
    auto& bending = figures.bending[static_cast<std::size_t>(d)];
    visit(FigureName{"B", "gf cm2/cm", "B_gfcm2_cm", direction[d]}, bending.b_gf_cm2_cm);
    visit(FigureName{"2HB", "gf cm/cm", "2HB_gfcm_cm", direction[d]}, bending.hb2_gf_cm_cm);
  }
}

/// A fabric whose tests give these figures. Each mode is the simplest curve that does:
///
///     tension  both branches F(x) = Fm (exp(b x) - 1) / (exp(b) - 1), x = e / EMT, with b from LT
///              when loading and from LT RT when unloading
///     shear    a loading curve of slope G, half widths on the line through 2HG/2 at 0.5 deg and
///              2HG5/2 at 5 deg, so that the elastic slope is G less that line's
///     bending  slope B, half width 2HB/2
///
/// Of EMT, LT and WT two give the third; where all are given and disagree, LT is taken in the
/// middle. What is missing is taken from the other direction, in proportion to what is given, or as
/// typical of woven clothes, and `assumptions` says so. Throws InvalidInput, beginning with
/// `source`, for figures that no fabric can have or that contradict each other.
Fabric fabric_from_figures(const KesFigures& figures, const std::string& source);

}  // namespace semblance
