// Dots followed from picture to picture.
#pragma once

#include <vector>

#include "semblance/cameras/dots.h"

namespace semblance {

struct DotTracks {
  std::vector<std::vector<int>> track_of_dot;  // per picture and dot
  int count = 0;
};

/// Follows dots through pictures in their order, as of a video. Each dot is expected where its
/// speed and the motion of the dots around it take it, and matched where the nearest is meant both
/// ways and no other is nearly as near: in doubt a track ends and a new one begins, so that no two
/// dots swap. Tracks bridge a few pictures in which their dot is not seen.
DotTracks follow_dots(const std::vector<std::vector<Dot>>& pictures);

}  // namespace semblance
