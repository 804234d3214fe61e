// A sum that tells files and inputs apart. Not against intent.
#pragma once

#include <cstdint>
#include <string_view>

namespace semblance {

/// FNV-1a, 64 bits, going on from `sum`.
inline std::uint64_t byte_sum(std::string_view bytes, std::uint64_t sum = 14695981039346656037ull) {
  for (const char byte : bytes) {
    sum = (sum ^ static_cast<unsigned char>(byte)) * 1099511628211ull;
  }
  return sum;
}

}  // namespace semblance
