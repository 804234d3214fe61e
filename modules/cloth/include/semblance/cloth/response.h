// Energies per area of one mode of deformation as functions of one number: the law behind a row.
#pragma once

#include "semblance/cloth/fabric.h"

namespace semblance {

/// Energy per area with its first two derivatives in the deformation.
struct LawPoint {
  double energy = 0.0;
  double force = 0.0;
  double stiffness = 0.0;
};

/// What cloth does when it is pushed together in its plane.
enum class CompressionLaw {
  buckling,    // yields at the Euler load of wrinkles too short for the mesh; smooth
  none,        // no resistance; buckling is left to interlaced springs (Choi and Ko 2002)
  as_tension,  // the measured tension curve backwards (mirages-2006, 5.3.3.8: "incorrect")
};

/// The measured curve for both signs.
LawPoint odd_response(const Curve& elastic, double deformation);

/// Tension by the measured curve; compression by `law`. Under `buckling` the force starts with the
/// slope of tension and saturates at `buckling_load_n_m`, with a remainder of a hundredth of the
/// slope that keeps elements from collapsing.
LawPoint tension_response(const Curve& elastic, CompressionLaw law, double buckling_load_n_m,
                          double strain);

/// Choi and Ko's interlaced spring of rest length `length_m` (ACM Trans. Graph. 21(3), 2002; the
/// force derived again from E = k_b length kappa^2 / 2), per area and in y = chord / length.
/// Shorter than at rest it is an arc of constant length, reached over a ramp of slope
/// `stretch_n_m`; longer, a linear spring of that slope.
LawPoint interlaced_response(double bending_n_m, double stretch_n_m, double length_m, double y);

/// Internal friction and viscosity over one step. Friction is a slider: a spring from `anchor` that
/// slips where it is stretched by `reach` and then pulls with `threshold` (the loop's half width);
/// over the step its potential is Huber's. Viscosity is `damping` (deformation - previous)^2 / 2.
struct Dissipation {
  double threshold = 0.0;
  double reach = 0.0;
  double anchor = 0.0;
  double damping = 0.0;
  double previous = 0.0;

  LawPoint evaluate(double deformation) const;
  /// The anchor after the step ended here: it follows where the slider slipped.
  double slipped_anchor(double deformation) const;
};

}  // namespace semblance
