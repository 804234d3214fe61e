// Eight lanes in plain C++. Every operation rounds exactly as its twins in simd_avx2.h and
// simd_avx512.h do, so that the kernels give the same bits with any. No standard headers: see
// kernels_avx2.cc.
#pragma once

#include <stdint.h>

namespace semblance::portable {

constexpr int lanes = 8;
constexpr unsigned all_lanes = 0xff;

struct Ints {
  int32_t lane[lanes];
};
struct Floats {
  float lane[lanes];
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
  for (int i = 0; i < lanes; ++i) result.lane[i] = body(i);
  return result;
}
inline int32_t wrap(uint32_t value) { return static_cast<int32_t>(value); }

inline Ints splat(int32_t a) {
  return each<Ints>([&](int) { return a; });
}
inline Floats splat(float a) {
  return each<Floats>([&](int) { return a; });
}
inline Ints iota() {
  return each<Ints>([](int i) { return i; });
}
inline Ints load(const int32_t* p) {
  return each<Ints>([&](int i) { return p[i]; });
}
inline Floats load(const float* p) {
  return each<Floats>([&](int i) { return p[i]; });
}
inline void store(int32_t* p, Ints a) { __builtin_memcpy(p, a.lane, 32); }
inline void store(float* p, Floats a) { __builtin_memcpy(p, a.lane, 32); }

inline Floats operator+(Floats a, Floats b) {
  return each<Floats>([&](int i) { return a.lane[i] + b.lane[i]; });
}
inline Floats operator-(Floats a, Floats b) {
  return each<Floats>([&](int i) { return a.lane[i] - b.lane[i]; });
}
inline Floats operator*(Floats a, Floats b) {
  return each<Floats>([&](int i) { return a.lane[i] * b.lane[i]; });
}
inline Floats operator/(Floats a, Floats b) {
  return each<Floats>([&](int i) { return a.lane[i] / b.lane[i]; });
}
inline Floats min(Floats a, Floats b) {
  return each<Floats>([&](int i) { return a.lane[i] < b.lane[i] ? a.lane[i] : b.lane[i]; });
}
inline Floats max(Floats a, Floats b) {
  return each<Floats>([&](int i) { return a.lane[i] > b.lane[i] ? a.lane[i] : b.lane[i]; });
}
inline Floats square_root(Floats a) {
  return each<Floats>([&](int i) { return __builtin_sqrtf(a.lane[i]); });
}
inline Ints operator+(Ints a, Ints b) {
  return each<Ints>([&](int i) { return wrap(uint32_t(a.lane[i]) + uint32_t(b.lane[i])); });
}
inline Ints operator-(Ints a, Ints b) {
  return each<Ints>([&](int i) { return wrap(uint32_t(a.lane[i]) - uint32_t(b.lane[i])); });
}
inline Ints operator*(Ints a, Ints b) {
  return each<Ints>([&](int i) { return wrap(uint32_t(a.lane[i]) * uint32_t(b.lane[i])); });
}
inline Ints operator&(Ints a, Ints b) {
  return each<Ints>([&](int i) { return a.lane[i] & b.lane[i]; });
}
inline Ints operator|(Ints a, Ints b) {
  return each<Ints>([&](int i) { return a.lane[i] | b.lane[i]; });
}
inline Ints operator^(Ints a, Ints b) {
  return each<Ints>([&](int i) { return a.lane[i] ^ b.lane[i]; });
}
inline Ints without(Ints a, Ints removed) {
  return each<Ints>([&](int i) { return a.lane[i] & ~removed.lane[i]; });
}
template <int N>
inline Ints shift_left(Ints a) {
  return each<Ints>([&](int i) { return wrap(uint32_t(a.lane[i]) << N); });
}
template <int N>
inline Ints shift_right(Ints a) {
  return each<Ints>([&](int i) { return a.lane[i] >> N; });
}
inline Ints min(Ints a, Ints b) {
  return each<Ints>([&](int i) { return a.lane[i] < b.lane[i] ? a.lane[i] : b.lane[i]; });
}
inline Ints max(Ints a, Ints b) {
  return each<Ints>([&](int i) { return a.lane[i] > b.lane[i] ? a.lane[i] : b.lane[i]; });
}
inline Ints operator>(Ints a, Ints b) {
  return each<Ints>([&](int i) { return a.lane[i] > b.lane[i] ? -1 : 0; });
}
inline Ints operator==(Ints a, Ints b) {
  return each<Ints>([&](int i) { return a.lane[i] == b.lane[i] ? -1 : 0; });
}
inline Ints operator>(Floats a, Floats b) {
  return each<Ints>([&](int i) { return a.lane[i] > b.lane[i] ? -1 : 0; });
}
/// `a` where the mask is set, else `b`.
inline Ints select(Ints mask, Ints a, Ints b) {
  return each<Ints>([&](int i) { return mask.lane[i] < 0 ? a.lane[i] : b.lane[i]; });
}
inline Floats select(Ints mask, Floats a, Floats b) {
  return each<Floats>([&](int i) { return mask.lane[i] < 0 ? a.lane[i] : b.lane[i]; });
}
/// One bit per lane: its sign.
inline unsigned sign_bits(Ints a) {
  unsigned bits = 0;
  for (int i = 0; i < lanes; ++i) bits |= (a.lane[i] < 0 ? 1u : 0u) << i;
  return bits;
}
inline int32_t highest_lane(Ints a) {
  int32_t highest = a.lane[0];
  for (int i = 1; i < lanes; ++i) highest = a.lane[i] > highest ? a.lane[i] : highest;
  return highest;
}
inline Floats to_float(Ints a) {
  return each<Floats>([&](int i) { return static_cast<float>(a.lane[i]); });
}
/// Nearest, ties to even.
inline Ints round_to_int(Floats a) {
  return each<Ints>([&](int i) { return static_cast<int32_t>(__builtin_rintf(a.lane[i])); });
}
/// Towards zero.
inline Ints truncate_to_int(Floats a) {
  return each<Ints>([&](int i) { return static_cast<int32_t>(a.lane[i]); });
}
/// The lanes named by `bits`, packed together at p; as many places as there are lanes may be
/// written.
inline void store_packed(int32_t* p, Ints a, unsigned bits) {
  int n = 0;
  for (int i = 0; i < lanes; ++i)
    if (bits >> i & 1u) p[n++] = a.lane[i];
}
inline void store_packed(float* p, Floats a, unsigned bits) {
  int n = 0;
  for (int i = 0; i < lanes; ++i)
    if (bits >> i & 1u) p[n++] = a.lane[i];
}
/// The same for 64-bit words of two halves.
inline void store_packed_words(uint64_t* p, Ints high, Ints low, unsigned bits) {
  int n = 0;
  for (int i = 0; i < lanes; ++i)
    if (bits >> i & 1u)
      p[n++] = uint64_t{uint32_t(high.lane[i])} << 32 | uint64_t{uint32_t(low.lane[i])};
}

/// Rows of three floats to three vectors, and back to rows of four.
inline void load_rows3(const float* p, Floats& x, Floats& y, Floats& z) {
  for (int i = 0; i < lanes; ++i)
    x.lane[i] = p[3 * i], y.lane[i] = p[3 * i + 1], z.lane[i] = p[3 * i + 2];
}
/// Row i of four values goes to p + i * stride_floats, in order, so later rows may cover the tail
/// of earlier ones.
inline void store_rows4(float* p, int stride_floats, Floats a, Floats b, Floats c, Floats d) {
  for (int i = 0; i < lanes; ++i) {
    const float row[4] = {a.lane[i], b.lane[i], c.lane[i], d.lane[i]};
    __builtin_memcpy(p + i * stride_floats, row, 16);
  }
}
inline Floats as_float(Ints a) {
  return each<Floats>([&](int i) { return float_of(a.lane[i]); });
}
inline Ints as_int(Floats a) {
  return each<Ints>([&](int i) { return bits_of(a.lane[i]); });
}
/// Rows of four floats number index[0], index[stride], ... to four vectors.
inline void gather_rows4(const float* base, const int32_t* index, int stride, Floats& a, Floats& b,
                         Floats& c, Floats& d) {
  for (int i = 0; i < lanes; ++i) {
    float row[4];
    __builtin_memcpy(row, base + 4 * int64_t{index[i * stride]}, 16);
    a.lane[i] = row[0], b.lane[i] = row[1], c.lane[i] = row[2], d.lane[i] = row[3];
  }
}
inline void store_rows8(float* p, const Floats* columns) {
  for (int i = 0; i < lanes; ++i)
    for (int k = 0; k < 8; ++k) p[8 * i + k] = columns[k].lane[i];
}
inline void gather_rows8(const float* base, const int32_t* index, Floats* columns) {
  for (int i = 0; i < lanes; ++i)
    for (int k = 0; k < 8; ++k) columns[k].lane[i] = base[8 * static_cast<int64_t>(index[i]) + k];
}
/// 64-bit words to their high and low halves.
inline void load_halves(const uint64_t* p, Ints& high, Ints& low) {
  for (int i = 0; i < lanes; ++i) {
    high.lane[i] = wrap(static_cast<uint32_t>(p[i] >> 32));
    low.lane[i] = wrap(static_cast<uint32_t>(p[i]));
  }
}
inline void store_zeros(uint64_t* p) { __builtin_memset(p, 0, 64); }
inline Floats gather(const float* base, Ints index) {
  return each<Floats>([&](int i) { return base[index.lane[i]]; });
}

}  // namespace semblance::portable
