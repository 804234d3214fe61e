// From detections to what the solvers take.
#pragma once

#include <string>

#include "semblance/cameras/detect.h"
#include "sheet_start.h"

namespace semblance {

/// Less points do not place a sheet safely.
constexpr int kFewestPoints = 6;

SheetView sheet_view(const Detection& detection);

/// Throws InvalidInput naming the picture where it shows the sheet's mirror image.
void check_not_mirrored(const Detection& detection, const std::string& name);

}  // namespace semblance
