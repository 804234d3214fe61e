// Eight lanes in plain C++. Every operation rounds exactly as its twin in simd_avx2.h does, so that
// the kernels give the same bits with either. No standard headers: see kernels_avx2.cc.
#pragma once

#include <stdint.h>

namespace semblance::portable {

struct I8 {
  int32_t lane[8];
};
struct F8 {
  float lane[8];
};

inline int32_t bits_of(float value) {
  int32_t bits;
  __builtin_memcpy(&bits, &value, 4);
  return bits;
}
inline float float_of(int32_t bits) {
  float value;
  __builtin_memcpy(&value, &bits, 4);
  return value;
}

template <class R, class Body>
inline R each(Body body) {
  R result;
  for (int i = 0; i < 8; ++i) result.lane[i] = body(i);
  return result;
}
inline int32_t wrap(uint32_t value) { return static_cast<int32_t>(value); }

inline I8 splat(int32_t a) {
  return each<I8>([&](int) { return a; });
}
inline F8 splat(float a) {
  return each<F8>([&](int) { return a; });
}
inline I8 iota() {
  return each<I8>([](int i) { return i; });
}
inline I8 load(const int32_t* p) {
  return each<I8>([&](int i) { return p[i]; });
}
inline F8 load(const float* p) {
  return each<F8>([&](int i) { return p[i]; });
}
inline void store(int32_t* p, I8 a) { __builtin_memcpy(p, a.lane, 32); }
inline void store(float* p, F8 a) { __builtin_memcpy(p, a.lane, 32); }

inline F8 operator+(F8 a, F8 b) {
  return each<F8>([&](int i) { return a.lane[i] + b.lane[i]; });
}
inline F8 operator-(F8 a, F8 b) {
  return each<F8>([&](int i) { return a.lane[i] - b.lane[i]; });
}
inline F8 operator*(F8 a, F8 b) {
  return each<F8>([&](int i) { return a.lane[i] * b.lane[i]; });
}
inline F8 operator/(F8 a, F8 b) {
  return each<F8>([&](int i) { return a.lane[i] / b.lane[i]; });
}
inline F8 min(F8 a, F8 b) {
  return each<F8>([&](int i) { return a.lane[i] < b.lane[i] ? a.lane[i] : b.lane[i]; });
}
inline F8 max(F8 a, F8 b) {
  return each<F8>([&](int i) { return a.lane[i] > b.lane[i] ? a.lane[i] : b.lane[i]; });
}
inline F8 square_root(F8 a) {
  return each<F8>([&](int i) { return __builtin_sqrtf(a.lane[i]); });
}
inline I8 operator+(I8 a, I8 b) {
  return each<I8>([&](int i) { return wrap(uint32_t(a.lane[i]) + uint32_t(b.lane[i])); });
}
inline I8 operator-(I8 a, I8 b) {
  return each<I8>([&](int i) { return wrap(uint32_t(a.lane[i]) - uint32_t(b.lane[i])); });
}
inline I8 operator*(I8 a, I8 b) {
  return each<I8>([&](int i) { return wrap(uint32_t(a.lane[i]) * uint32_t(b.lane[i])); });
}
inline I8 operator&(I8 a, I8 b) {
  return each<I8>([&](int i) { return a.lane[i] & b.lane[i]; });
}
inline I8 operator|(I8 a, I8 b) {
  return each<I8>([&](int i) { return a.lane[i] | b.lane[i]; });
}
inline I8 operator^(I8 a, I8 b) {
  return each<I8>([&](int i) { return a.lane[i] ^ b.lane[i]; });
}
inline I8 without(I8 a, I8 removed) {
  return each<I8>([&](int i) { return a.lane[i] & ~removed.lane[i]; });
}
template <int N>
inline I8 shift_left(I8 a) {
  return each<I8>([&](int i) { return wrap(uint32_t(a.lane[i]) << N); });
}
template <int N>
inline I8 shift_right(I8 a) {
  return each<I8>([&](int i) { return a.lane[i] >> N; });
}
inline I8 min(I8 a, I8 b) {
  return each<I8>([&](int i) { return a.lane[i] < b.lane[i] ? a.lane[i] : b.lane[i]; });
}
inline I8 max(I8 a, I8 b) {
  return each<I8>([&](int i) { return a.lane[i] > b.lane[i] ? a.lane[i] : b.lane[i]; });
}
inline I8 operator>(I8 a, I8 b) {
  return each<I8>([&](int i) { return a.lane[i] > b.lane[i] ? -1 : 0; });
}
inline I8 operator==(I8 a, I8 b) {
  return each<I8>([&](int i) { return a.lane[i] == b.lane[i] ? -1 : 0; });
}
inline I8 operator>(F8 a, F8 b) {
  return each<I8>([&](int i) { return a.lane[i] > b.lane[i] ? -1 : 0; });
}
/// `a` where the mask is set, else `b`.
inline I8 select(I8 mask, I8 a, I8 b) {
  return each<I8>([&](int i) { return mask.lane[i] < 0 ? a.lane[i] : b.lane[i]; });
}
inline F8 select(I8 mask, F8 a, F8 b) {
  return each<F8>([&](int i) { return mask.lane[i] < 0 ? a.lane[i] : b.lane[i]; });
}
/// One bit per lane: its sign.
inline unsigned sign_bits(I8 a) {
  unsigned bits = 0;
  for (int i = 0; i < 8; ++i) bits |= (a.lane[i] < 0 ? 1u : 0u) << i;
  return bits;
}
inline int32_t highest_lane(I8 a) {
  int32_t highest = a.lane[0];
  for (int i = 1; i < 8; ++i) highest = a.lane[i] > highest ? a.lane[i] : highest;
  return highest;
}
inline F8 to_float(I8 a) {
  return each<F8>([&](int i) { return static_cast<float>(a.lane[i]); });
}
/// Nearest, ties to even.
inline I8 round_to_int(F8 a) {
  return each<I8>([&](int i) { return static_cast<int32_t>(__builtin_rintf(a.lane[i])); });
}
/// Towards zero.
inline I8 truncate_to_int(F8 a) {
  return each<I8>([&](int i) { return static_cast<int32_t>(a.lane[i]); });
}
/// The lanes named by `bits`, packed together at p; all eight places are written.
inline void store_packed(int32_t* p, I8 a, unsigned bits) {
  int n = 0;
  for (int i = 0; i < 8; ++i)
    if (bits >> i & 1u) p[n++] = a.lane[i];
}
inline void store_packed(float* p, F8 a, unsigned bits) {
  int n = 0;
  for (int i = 0; i < 8; ++i)
    if (bits >> i & 1u) p[n++] = a.lane[i];
}

/// Rows of three floats to three vectors, and back to rows of four.
inline void load_rows3(const float* p, F8& x, F8& y, F8& z) {
  for (int i = 0; i < 8; ++i)
    x.lane[i] = p[3 * i], y.lane[i] = p[3 * i + 1], z.lane[i] = p[3 * i + 2];
}
/// Row i of four values goes to p + i * stride_floats, in order, so later rows may cover the tail
/// of earlier ones.
inline void store_rows4(float* p, int stride_floats, F8 a, F8 b, F8 c, F8 d) {
  for (int i = 0; i < 8; ++i) {
    const float row[4] = {a.lane[i], b.lane[i], c.lane[i], d.lane[i]};
    __builtin_memcpy(p + i * stride_floats, row, 16);
  }
}
inline F8 as_float(I8 a) {
  return each<F8>([&](int i) { return float_of(a.lane[i]); });
}
inline I8 as_int(F8 a) {
  return each<I8>([&](int i) { return bits_of(a.lane[i]); });
}
/// Rows of four floats number index[0], index[stride], ... to four vectors.
inline void gather_rows4(const float* base, const int32_t* index, int stride, F8& a, F8& b, F8& c,
                         F8& d) {
  for (int i = 0; i < 8; ++i) {
    float row[4];
    __builtin_memcpy(row, base + 4 * int64_t{index[i * stride]}, 16);
    a.lane[i] = row[0], b.lane[i] = row[1], c.lane[i] = row[2], d.lane[i] = row[3];
  }
}
inline void store_rows8(float* p, const F8* columns) {
  for (int i = 0; i < 8; ++i)
    for (int k = 0; k < 8; ++k) p[8 * i + k] = columns[k].lane[i];
}
inline void gather_rows8(const float* base, const int32_t* index, F8* columns) {
  for (int i = 0; i < 8; ++i)
    for (int k = 0; k < 8; ++k) columns[k].lane[i] = base[8 * static_cast<int64_t>(index[i]) + k];
}
/// Eight 64-bit words to their high and low halves.
inline void load_halves(const uint64_t* p, I8& high, I8& low) {
  for (int i = 0; i < 8; ++i) {
    high.lane[i] = wrap(static_cast<uint32_t>(p[i] >> 32));
    low.lane[i] = wrap(static_cast<uint32_t>(p[i]));
  }
}
inline void store_zeros(uint64_t* p) { __builtin_memset(p, 0, 64); }
inline F8 gather(const float* base, I8 index) {
  return each<F8>([&](int i) { return base[index.lane[i]]; });
}

}  // namespace semblance::portable
