// Pictures and a page that show an object's calibration.
#pragma once

#include <string>
#include <vector>

#include "semblance/io/video.h"
#include "semblance/object/object_calibration.h"

namespace semblance {

/// The picture with the mesh drawn over it where `estimate` has it: its outline, the cuts of planes
/// a tenth of its size apart, and the pairs (a cross where one was given, a line to where its point
/// is). `index`: of the picture.
Rgb8 object_overlay(const ObjectTarget& target, const ObjectPicture& picture,
                    const ObjectEstimate& estimate, std::size_t index);

/// Both estimates side by side, that from pairs on the left; or the one there is.
Rgb8 object_overlays(const ObjectTarget& target, const ObjectPicture& picture,
                     const ObjectCalibration& calibration, std::size_t index);

/// Writes one self-contained HTML file: figures, notes, the camera's parameters and each picture's
/// pose with deviations, and the overlays. `overlays`: one per picture.
void write_object_report(const std::string& path, const std::string& title,
                         const std::vector<ObjectPicture>& pictures,
                         const ObjectCalibration& calibration, const std::vector<Rgb8>& overlays);

}  // namespace semblance
