// What a woven fabric is mechanically: one response per mode of deformation, as measured.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "semblance/cloth/curve.h"

namespace semblance {

/// How a fabric answers one mode of deformation e, elastically and with friction between its yarns:
///
///     force = sign(e) elastic(|e|) + friction(|e|) s + viscosity_s * d/dt (sign(e) elastic(|e|))
///     s <- clamp(s + de / reversal, -1, 1)
///
/// s is an elasto-plastic slider. Far from a turn it is at +-1, so the loading curve is elastic +
/// friction and the unloading curve elastic - friction. From rest it slides after `reversal`, and
/// twice that turns it round, however small the force is: yarns that are hardly pressed together
/// grip no harder than their friction lets them.
///
///     mode     deformation           force
///     tension  strain                per width, N/m
///     shear    angle, rad            per width, N/m
///     bending  curvature, 1/m        moment per width, N (N m/m)
///
/// The curves hold for e >= 0 and are continued oddly (friction evenly). Compression is not
/// measured by tension tests: whoever simulates a sheet chooses what happens there.
struct ModeResponse {
  Curve elastic;             ///< mean of the loading and the unloading curve; 0 at 0
  Curve friction;            ///< half of the distance between them; not negative
  double reversal = 1.0;     ///< the slider's travel, in units of the deformation; positive
  double viscosity_s = 0.0;  ///< the part of Rayleigh's damping that goes with the stiffness

  bool operator==(const ModeResponse&) const = default;
};

/// The force along the loading curve from rest, elastic + friction min(1, e / reversal), as an
/// elastic curve: what the mode answers while its deformation only grows.
Curve loading_curve(const ModeResponse& mode);

/// Part of the measured range that the slider travels where nothing else is known.
constexpr double default_reversal_fraction = 0.02;
/// Viscosity where none was measured: 3 % of critical damping at 10 Hz.
constexpr double default_viscosity_s = 1e-3;

/// elastic = stiffness e over [0, end], constant friction.
ModeResponse linear_response(double stiffness, double end, double friction = 0.0);

/// What a measured loop shows where it begins and turns.
enum class Turns {
  /// The branches meet at 0 and at the end, as in tension: their distance tells the friction even
  /// where the slider is under way.
  closing,
  /// The slider is under way, as in shear and bending: within `reversal` of 0 on the loading curve,
  /// and twice that of the end on the unloading curve, points do not show the threshold. They are
  /// left out, and the curves go on there by their tangents.
  sliding,
};

/// From a measured loop that starts at rest at 0, turns at the curves' common end, and comes back.
/// reversal 0 means the default fraction of the range. Throws InvalidInput, beginning with
/// `source`, where the curves do not end together, the unloading curve lies above the loading
/// curve, or their mean falls.
ModeResponse response_from_loop(const Curve& loading, const Curve& unloading, Turns turns,
                                double reversal, const std::string& source);

/// Index of a direction in Fabric's pairs.
enum Direction { warp = 0, weft = 1 };

/// A woven fabric. Units SI; see ModeResponse for those of its modes.
struct Fabric {
  std::string name;
  double area_density_kg_m2 = 0.0;
  double thickness_m = 0.0;
  double friction = 0.0;  ///< coefficient between the fabric and what it touches
  double mass_damping_1_s = 0.0;
  std::array<ModeResponse, 2> tension, bending;  ///< by Direction
  ModeResponse shear;
  std::optional<ModeResponse> bending_bias;  ///< bent along 45 degrees, where measured
  /// What was not given, and what was assumed instead: one sentence each.
  std::vector<std::string> assumptions;

  bool operator==(const Fabric&) const = default;
};

/// Values taken where a fabric's are not known; each use adds a sentence to `assumptions`.
namespace assumed {
/// Median of 618 fabrics (Feng et al., ACM TOG 2022).
constexpr double area_density_kg_m2 = 0.197;
/// Mass of woven cloth per volume between KES-FB3's plates at 0.5 gf/cm2; 300 to 450 are usual.
constexpr double bulk_density_kg_m3 = 350.0;
/// Cloth on cloth and on wood lies between 0.2 and 0.5.
constexpr double friction = 0.3;
/// For the air around it: free swinging fades within about two seconds.
constexpr double mass_damping_1_s = 0.5;
}  // namespace assumed

/// Fills area density, thickness, friction and damping that are not given, and says so.
void complete_fabric(Fabric& fabric, std::optional<double> friction,
                     std::optional<double> mass_damping_1_s);

/// Sentences for modes that have default_viscosity_s, and default_reversal_fraction.
std::string viscosity_assumption();
std::string reversal_assumption();

/// Throws one InvalidInput that begins with `source` and lists everything that cannot be so: values
/// that are not finite or negative, curves that are not monotone, and values outside what fabrics
/// have, with the unit that was probably meant.
void validate(const Fabric& fabric, const std::string& source);

/// Resistance to twist, from bending along the bias. A sheet bent by k along 45 degrees is bent by
/// k/2 along warp, by k/2 along weft and twisted by k/2, and does the work of all three, so
///
///     M_bias(k) = (M_warp(k/2) + M_weft(k/2) + M_twist(k/2)) / 2
///     M_twist(k) = 2 M_bias(2k) - M_warp(k) - M_weft(k)
///
/// with M_twist the moment conjugate to the twist k (for an isotropic plate of rigidity D and
/// Poisson's ratio 0: M_bias = D k and M_twist = 2 D k). Friction obeys the same identity and is
/// kept from falling below 0. Where the bias was not measured, M_twist = M_warp + M_weft without
/// friction: for straight lines and constant friction the loop along the bias is then the mean of
/// warp's and weft's. Throws InvalidInput where a measured bias is too weak to be possible.
ModeResponse twist_response(const Fabric& fabric);

}  // namespace semblance
