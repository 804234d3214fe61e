// The two encodings of COLMAP's sparse models, on bytes: for files and for fuzzing.
#pragma once

#include <string>
#include <string_view>

#include "semblance/io/colmap.h"

namespace semblance::colmap {

/// Contents of cameras, images and points3D, in COLMAP's order.
struct Contents {
  std::string cameras, images, points;
};

/// How many parameters a camera model has; 0 for one that is not known here.
int parameter_count(std::string_view model);
/// COLMAP's number of a model and back; "" and -1 for those not known here.
std::string_view model_name(int number);
int model_number(std::string_view name);

/// The models known here, for messages.
std::string known_models();

/// A figure within what an image may have; InvalidInput naming the place otherwise.
int checked_size(std::uint64_t pixels, const std::string& place);

ColmapModel parse_text(const Contents& contents, const std::string& folder);
ColmapModel parse_binary(const Contents& contents, const std::string& folder);
Contents text_of(const ColmapModel& model, const std::string& folder);
Contents bytes_of(const ColmapModel& model);

}  // namespace semblance::colmap
