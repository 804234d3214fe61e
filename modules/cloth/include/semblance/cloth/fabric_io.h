// Files of fabrics (docs/formats/fabric.md): JSON, CSV of measured curves, CSV of KES figures.
#pragma once

#include <string>

#include "semblance/cloth/fabric.h"
#include "semblance/cloth/kes.h"
#include "semblance/cloth/kes_loops.h"

namespace semblance {

/// A fabric and what is known of its tests.
struct FabricRecord {
  Fabric fabric;
  KesFigures given;   ///< as the file has them, or read off `loops`
  KesLoops measured;  ///< the file's loading and unloading points
  /// Those, joined by curves in tension, and steady loops of what is given otherwise; empty for
  /// modes that were assumed.
  KesLoops loops;
};

/// Reads .json or .csv. A CSV of figures holds many fabrics: `name` chooses one, or the path does
/// as "fabrics.csv:NAME". The fabric is complete and valid; what was not given is assumed, and said
/// so in its `assumptions`. Throws InvalidInput naming file, line or key and the remedy; IoError.
FabricRecord read_fabric_record(const std::string& path, const std::string& name = "");
/// The fabric alone.
Fabric read_fabric(const std::string& path, const std::string& name = "");

/// Writes JSON in SI units; read back, the fabric is the same to the last bit. Throws InvalidInput
/// unless the path ends in .json; IoError.
void write_fabric(const std::string& path, const Fabric& fabric);

/// Writes loops as a CSV of curves, in KES units; empty loops are left out.
void write_loops(const std::string& path, const std::string& name, const KesLoops& loops);

}  // namespace semblance
