#include "gltf_accessor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstring>

#include "semblance/core/errors.h"

namespace semblance {
namespace {

constexpr std::size_t most_rows = 20'000'000;

}  // namespace

void fail_gltf(const std::string& source, const std::string& what) {
  throw InvalidInput(fmt::format("{}: {}", source, what));
}

GltfAccessorReader::GltfAccessorReader(const tinygltf::Model& model, const std::string& source)
    : model_(model), source_(source) {
  constexpr std::size_t most = std::size_t{1} << 27, always = std::size_t{1} << 24, per_byte = 64;
  std::size_t bytes = 0;
  for (const tinygltf::Buffer& buffer : model.buffers) bytes += buffer.data.size();
  values_left_ = std::min(most, always + per_byte * bytes);
}

GltfValues GltfAccessorReader::read(int index, int width, const char* what) {
  const tinygltf::Accessor& accessor = gltf_item(model_.accessors, index, what, source_);
  if (accessor.count == 0 || accessor.count > most_rows ||
      tinygltf::GetNumComponentsInType(accessor.type) != width) {
    fail_gltf(source_, fmt::format("{}: an accessor with {} components and 1 to {} rows was "
                                   "expected",
                                   what, width, most_rows));
  }
  spend(accessor.count, static_cast<std::size_t>(width));
  GltfValues values;
  if (accessor.bufferView >= 0) {
    const Span span = find(accessor.bufferView, accessor.byteOffset, accessor.count,
                           accessor.componentType, width, what);
    values.resize(static_cast<Eigen::Index>(accessor.count), width);
    for (std::size_t row = 0; row < accessor.count; ++row) {
      for (int i = 0; i < width; ++i) {
        values(row, i) = static_cast<float>(component(span, row, i, accessor.normalized, what));
      }
    }
  } else {
    values = GltfValues::Zero(static_cast<Eigen::Index>(accessor.count), width);
  }
  if (accessor.sparse.isSparse) read_sparse(accessor, width, what, values);
  if (!values.allFinite()) fail_gltf(source_, fmt::format("{}: a value is not finite", what));
  return values;
}

std::vector<int> GltfAccessorReader::read_indices(int index, Eigen::Index vertex_count) {
  const tinygltf::Accessor& accessor = gltf_item(model_.accessors, index, "indices", source_);
  if (accessor.type != TINYGLTF_TYPE_SCALAR || accessor.sparse.isSparse) {
    fail_gltf(source_, "indices: a dense scalar accessor was expected");
  }
  const Span span = find(accessor.bufferView, accessor.byteOffset, accessor.count,
                         accessor.componentType, 1, "indices");
  spend(accessor.count, 1);
  std::vector<int> indices(accessor.count);
  for (std::size_t row = 0; row < accessor.count; ++row) {
    indices[row] = checked_index(component(span, row, 0, false, "indices"), vertex_count);
  }
  return indices;
}

Eigen::Index GltfAccessorReader::row_count(int index, const char* what) const {
  const std::size_t count = gltf_item(model_.accessors, index, what, source_).count;
  if (count > most_rows) fail_gltf(source_, fmt::format("{}: {} rows are too many", what, count));
  return static_cast<Eigen::Index>(count);
}

void GltfAccessorReader::spend(std::size_t rows, std::size_t width) {
  if (width > 0 && rows > values_left_ / width) {
    fail_gltf(source_, "stands for more numbers than are read of a file of its size");
  }
  values_left_ -= rows * width;
}

/// The bytes of `count` rows; throws unless all of them lie in the view and the buffer.
GltfAccessorReader::Span GltfAccessorReader::find(int view_index, std::size_t offset,
                                                  std::size_t count, int component_type, int width,
                                                  const char* what) const {
  const tinygltf::BufferView& view = gltf_item(model_.bufferViews, view_index, what, source_);
  const tinygltf::Buffer& buffer = gltf_item(model_.buffers, view.buffer, what, source_);
  Span span;
  span.component_type = component_type;
  span.component_size =
      tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(component_type));
  const std::size_t row_bytes =
      span.component_size > 0 ? static_cast<std::size_t>(span.component_size) * width : 0;
  span.stride = view.byteStride == 0 ? row_bytes : view.byteStride;
  const bool fits_buffer = view.byteOffset <= buffer.data.size() &&
                           view.byteLength <= buffer.data.size() - view.byteOffset;
  const bool fits_view = row_bytes > 0 && count > 0 && offset <= view.byteLength &&
                         row_bytes <= view.byteLength - offset && span.stride >= row_bytes &&
                         (view.byteLength - offset - row_bytes) / span.stride >= count - 1;
  if (!fits_buffer || !fits_view) {
    fail_gltf(source_, fmt::format("{}: its {} rows do not fit into the file's data", what, count));
  }
  span.data = buffer.data.data() + view.byteOffset + offset;
  return span;
}

double GltfAccessorReader::component(const Span& span, std::size_t row, int column, bool normalized,
                                     const char* what) const {
  const unsigned char* at = span.data + row * span.stride + column * span.component_size;
  const auto load = [at]<typename T>(T value) {
    std::memcpy(&value, at, sizeof(T));
    return value;
  };
  switch (span.component_type) {
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return load(float{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return load(std::uint8_t{}) / (normalized ? 255.0 : 1.0);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return load(std::uint16_t{}) / (normalized ? 65535.0 : 1.0);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return load(std::uint32_t{});
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return std::max(load(std::int8_t{}) / (normalized ? 127.0 : 1.0), normalized ? -1.0 : -128.0);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return std::max(load(std::int16_t{}) / (normalized ? 32767.0 : 1.0),
                      normalized ? -1.0 : -32768.0);
    default:
      fail_gltf(source_,
                fmt::format("{}: component type {} is not known", what, span.component_type));
  }
}

int GltfAccessorReader::checked_index(double index, Eigen::Index count) const {
  if (!(index >= 0.0 && index < static_cast<double>(count))) {
    fail_gltf(source_, fmt::format("vertex {} does not exist; there are {}", index, count));
  }
  return static_cast<int>(index);
}

void GltfAccessorReader::read_sparse(const tinygltf::Accessor& accessor, int width,
                                     const char* what, GltfValues& values) const {
  const auto& sparse = accessor.sparse;
  if (sparse.count <= 0 || static_cast<std::size_t>(sparse.count) > accessor.count ||
      sparse.indices.byteOffset < 0 || sparse.values.byteOffset < 0) {
    fail_gltf(source_, fmt::format("{}: its sparse part is damaged", what));
  }
  const auto count = static_cast<std::size_t>(sparse.count);
  const Span indices =
      find(sparse.indices.bufferView, static_cast<std::size_t>(sparse.indices.byteOffset), count,
           sparse.indices.componentType, 1, what);
  const Span rows =
      find(sparse.values.bufferView, static_cast<std::size_t>(sparse.values.byteOffset), count,
           accessor.componentType, width, what);
  for (std::size_t i = 0; i < count; ++i) {
    const int row = checked_index(component(indices, i, 0, false, what), values.rows());
    for (int k = 0; k < width; ++k) {
      values(row, k) = static_cast<float>(component(rows, i, k, accessor.normalized, what));
    }
  }
}

}  // namespace semblance
