// OpenCV's marker dictionaries by their names.
#pragma once

#include <opencv2/aruco.hpp>
#include <optional>
#include <string>
#include <vector>

namespace semblance {

std::vector<std::string> dictionary_names();
/// How many markers a dictionary has; none where the name is unknown.
std::optional<int> dictionary_size(const std::string& name);
/// The dictionary of a name that is known.
cv::Ptr<cv::aruco::Dictionary> dictionary_of(const std::string& name);

}  // namespace semblance
