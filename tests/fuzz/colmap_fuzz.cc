// COLMAP models. The first byte chooses text or binary, the next four say how long the parts for
// cameras and images are; the rest is for points. What is read can be written and read again.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string_view>

#include "colmap_files.h"
#include "semblance/core/errors.h"

namespace {

std::string take(std::string_view& rest, std::size_t size) {
  const std::string part(rest.substr(0, size));
  rest.remove_prefix(std::min(size, rest.size()));
  return part;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace semblance;
  std::uint16_t lengths[2];
  if (size < 1 + sizeof(lengths)) return 0;
  std::memcpy(lengths, data + 1, sizeof(lengths));
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  rest.remove_prefix(1 + sizeof(lengths));
  colmap::Contents contents;
  contents.cameras = take(rest, lengths[0]);
  contents.images = take(rest, lengths[1]);
  contents.points = rest;
  ColmapModel model;
  try {
    model = data[0] % 2 == 0 ? colmap::parse_text(contents, "fuzz")
                             : colmap::parse_binary(contents, "fuzz");
    validate(model, "fuzz");
    rig_from_colmap(model);
  } catch (const InvalidInput&) {
    return 0;  // The only answer to bad input.
  }
  const ColmapModel again = colmap::parse_binary(colmap::bytes_of(model), "fuzz");
  if (again.images.size() != model.images.size()) std::abort();
  return 0;
}
