// How the vertices of a surface hang together.
#pragma once

namespace semblance {

/// An edge seen from one of its ends: its number, and the vertex at the other end.
struct SurfaceSpoke {
  int edge = 0, other = 0;
};

}  // namespace semblance
