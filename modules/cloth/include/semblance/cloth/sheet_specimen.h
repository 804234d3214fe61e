// Specimens of KES tests cut from a simulated sheet.
#pragma once

#include "semblance/cloth/kes_loops.h"
#include "semblance/cloth/sheet_energy.h"

namespace semblance {

/// Specimens that are sheets: every reading places all vertices of a small sheet in the test's
/// homogeneous shape (pulled along a yarn with the other held; sheared with yarns of constant
/// length; bent to an arc between clamps), and is the work that the sheet's energy, friction
/// included, does per area and change of the deformation. So it shows what a simulation makes of
/// the fabric: mesh, energies, their gradient and their memory.
Specimens sheet_specimens(const Fabric& fabric, const SheetModel& model = {});

}  // namespace semblance
