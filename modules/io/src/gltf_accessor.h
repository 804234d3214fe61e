// The numbers of a glTF file.
#pragma once

#include <tiny_gltf.h>

#include <Eigen/Core>
#include <string>
#include <vector>

namespace semblance {

using GltfValues = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

[[noreturn]] void fail_gltf(const std::string& source, const std::string& what);

/// The entry of that number; throws InvalidInput, naming `what`, unless it exists.
template <typename T>
const T& gltf_item(const std::vector<T>& items, int index, const char* what,
                   const std::string& source) {
  if (index < 0 || index >= static_cast<int>(items.size())) {
    fail_gltf(source, std::string(what) + ": number " + std::to_string(index) + " does not exist");
  }
  return items[static_cast<std::size_t>(index)];
}

/// Reads accessors (section 3.6.2 of the specification); every index and range in the file is
/// checked before it is used. Few bytes can stand for many numbers (zeros that are not stored, one
/// accessor used many times), so these are counted.
class GltfAccessorReader {
 public:
  GltfAccessorReader(const tinygltf::Model& model, const std::string& source);

  /// The accessor's rows of `width` numbers (normalised integers become -1 or 0 to 1); all finite.
  GltfValues read(int index, int width, const char* what);
  std::vector<int> read_indices(int index, Eigen::Index vertex_count);
  Eigen::Index row_count(int index, const char* what) const;
  /// Counts numbers that are to be made of the file; throws InvalidInput where they are too many.
  void spend(std::size_t rows, std::size_t width);

 private:
  struct Span {
    const unsigned char* data = nullptr;
    std::size_t stride = 0;
    int component_type = 0, component_size = 0;
  };

  Span find(int view_index, std::size_t offset, std::size_t count, int component_type, int width,
            const char* what) const;
  double component(const Span& span, std::size_t row, int column, bool normalized,
                   const char* what) const;
  int checked_index(double index, Eigen::Index count) const;
  void read_sparse(const tinygltf::Accessor& accessor, int width, const char* what,
                   GltfValues& values) const;

  const tinygltf::Model& model_;
  const std::string& source_;
  std::size_t values_left_ = 0;
};

}  // namespace semblance
