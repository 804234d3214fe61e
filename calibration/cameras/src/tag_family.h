// libapriltag's family tag36h11 with a border of 1 or 2 bits.
#pragma once

#include <apriltag/apriltag.h>

#include <memory>

namespace semblance {

struct TagFamilyDeleter {
  void operator()(apriltag_family_t* family) const;
};
using TagFamily = std::unique_ptr<apriltag_family_t, TagFamilyDeleter>;

TagFamily make_tag_family(int border_bits);

}  // namespace semblance
