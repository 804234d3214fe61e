// Which sheet a picture shows.
#pragma once

#include <opencv2/core.hpp>

#include "semblance/cameras/detect.h"

namespace semblance {

/// The sheet, with sizes relative to `size_m`; automatic where none is recognised. `assumed` says
/// that the picture may show only a part of it.
Target identify_sheet(const cv::Mat& grey, double size_m, bool& assumed);

}  // namespace semblance
