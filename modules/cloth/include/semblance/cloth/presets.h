// Experiments with cloth that are set up by name.
#pragma once

#include <string>
#include <vector>

#include "semblance/cloth/drape.h"
#include "semblance/cloth/simulation.h"

namespace semblance {

/// table       sheet of 1.0 x 0.8 m laid on a table of 0.6 x 0.5 m, 0.7 m high, off its middle by
///             (5 cm, -4 cm): the experiment of mirages-2006, 5.3.3
/// pinned      1 x 1 m, held at two corners, let go when horizontal
/// pinned-box  the same before a box that it swings against
/// disc        Cusick's drape test (ISO 9073-9): a disc of 0.15 m radius, clamped on one of 0.09 m
/// strip       cantilever: 0.2 m free length, 0.02 m wide, clamped at one end
std::vector<std::string> preset_names();

/// The start that presets have where none is asked for.
inline constexpr int first_start = 1;

/// The scene of a preset. The sheet faces up and starts flat, above a support by 0.8 of the
/// fabric's thickness. That of `disc` has dents outside the clamp of about a millimetre, others
/// for each `start`: which folds form depends on them. Throws InvalidInput, listing the names,
/// where there is no such preset, and where the spacing (m) does not fit.
ClothScene make_preset(const std::string& name, double spacing_m, const Fabric& fabric,
                       int start = first_start);

/// The same for `simulate`, with the preset's usual spacing.
SimulationSetup preset_setup(const std::string& name, const Fabric& fabric,
                             int start = first_start);

/// "default": bending by curvature, compression yields by buckling; "choi-ko": interlaced springs;
/// "as-tension": compression resists as tension does. Throws InvalidInput listing the names.
SheetModel make_sheet_model(const std::string& name, bool hysteresis);

/// Positions of a sheet that lies horizontally and faces up: u along x, v along -z, (u, v) = (0, 0)
/// at `origin_m`.
Points lay_flat(const Sheet& sheet, const Eigen::Vector3d& origin_m);

}  // namespace semblance
