#include "semblance/io/mesh_io.h"

#include "semblance/core/errors.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

[[noreturn]] void fail(const std::string& path) {
  throw InvalidInput(path + ": a mesh (.obj, .ply) was expected");
}

}  // namespace

Mesh read_mesh(const std::string& path) {
  const std::string extension = text::lower_extension(path);
  if (extension == ".ply") return read_ply(path);
  if (extension == ".obj") return read_obj(path).mesh;
  fail(path);
}

void write_mesh(const std::string& path, const Mesh& mesh) {
  const std::string extension = text::lower_extension(path);
  if (extension == ".ply") return write_ply(path, mesh);
  if (extension == ".obj") return write_obj(path, mesh);
  fail(path);
}

}  // namespace semblance
