// What the readers of fabrics share: modes by name and unit, and the fabric made of what was read.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "semblance/cloth/fabric_io.h"

namespace semblance {

enum class ModeKind { tension, shear, bending };
enum class FabricUnits { si, kes };

/// Scales to SI.
struct ModeUnits {
  double deformation, force;
};
ModeUnits units_of(ModeKind kind, FabricUnits units);

constexpr std::size_t mode_count = 6;
struct ModeName {
  const char* key;
  ModeKind kind;
};
constexpr std::array<ModeName, mode_count> mode_names{{{"tension_warp", ModeKind::tension},
                                                       {"tension_weft", ModeKind::tension},
                                                       {"shear", ModeKind::shear},
                                                       {"bending_warp", ModeKind::bending},
                                                       {"bending_weft", ModeKind::bending},
                                                       {"bending_bias", ModeKind::bending}}};
/// The loop of a mode, by its index in mode_names.
Loop& loop_of(KesLoops& loops, std::size_t mode);
const Loop& loop_of(const KesLoops& loops, std::size_t mode);

/// More points than any machine records, and few enough to be quick.
constexpr std::size_t most_curve_points = 4096;

/// A mode's curves as read, in SI units.
struct ModePoints {
  Loop loading, unloading;  // in any order
};

/// What a file says of a fabric.
struct FabricParts {
  std::string name;
  std::optional<double> area_density_kg_m2, thickness_m, friction, mass_damping_1_s;
  std::array<std::optional<ModeResponse>, mode_count> modes;
  std::vector<std::string> assumptions;
  KesLoops measured, smooth;  // the readings, and curves through those of tension
  bool assumes_viscosity = false, assumes_reversal = false;
};

/// Makes the mode from its points and keeps them as its measured loop. reversal 0: the default.
/// Throws InvalidInput that begins with `source`.
void add_measured_mode(FabricParts& parts, std::size_t mode, const ModePoints& points,
                       double reversal, const std::string& source);

/// The fabric, completed and checked.
FabricRecord assemble_fabric(FabricParts parts, const std::string& source);

// The readers of text behind read_fabric; for fuzzing too.
FabricRecord parse_fabric_json(std::string_view content, const std::string& source);
FabricRecord parse_fabric_curves(std::string_view content, const std::string& source);
FabricRecord parse_fabric_figures(std::string_view content, const std::string& source,
                                  const std::string& name);
/// Either kind of CSV, by its first line.
FabricRecord parse_fabric_csv(std::string_view content, const std::string& source,
                              const std::string& name);

}  // namespace semblance
