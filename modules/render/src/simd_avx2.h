// Eight lanes in AVX2. See simd_portable.h for what each operation does. Only kernels_avx2.cc may
// include this.
#pragma once

#include <immintrin.h>
#include <stdint.h>

namespace semblance::avx2 {

constexpr int lanes = 8;
constexpr unsigned all_lanes = 0xff;

struct Ints {
  __m256i v;
};
struct Floats {
  __m256 v;
};

inline Ints splat(int32_t a) { return {_mm256_set1_epi32(a)}; }
inline Floats splat(float a) { return {_mm256_set1_ps(a)}; }
inline Ints iota() { return {_mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7)}; }
inline Ints load(const int32_t* p) { return {_mm256_loadu_si256((const __m256i*)p)}; }
inline Floats load(const float* p) { return {_mm256_loadu_ps(p)}; }
inline void store(int32_t* p, Ints a) { _mm256_storeu_si256((__m256i*)p, a.v); }
inline void store(float* p, Floats a) { _mm256_storeu_ps(p, a.v); }

inline Floats operator+(Floats a, Floats b) { return {_mm256_add_ps(a.v, b.v)}; }
inline Floats operator-(Floats a, Floats b) { return {_mm256_sub_ps(a.v, b.v)}; }
inline Floats operator*(Floats a, Floats b) { return {_mm256_mul_ps(a.v, b.v)}; }
inline Floats operator/(Floats a, Floats b) { return {_mm256_div_ps(a.v, b.v)}; }
inline Floats min(Floats a, Floats b) { return {_mm256_min_ps(a.v, b.v)}; }
inline Floats max(Floats a, Floats b) { return {_mm256_max_ps(a.v, b.v)}; }
inline Floats square_root(Floats a) { return {_mm256_sqrt_ps(a.v)}; }
inline Ints operator+(Ints a, Ints b) { return {_mm256_add_epi32(a.v, b.v)}; }
inline Ints operator-(Ints a, Ints b) { return {_mm256_sub_epi32(a.v, b.v)}; }
inline Ints operator*(Ints a, Ints b) { return {_mm256_mullo_epi32(a.v, b.v)}; }
inline Ints operator&(Ints a, Ints b) { return {_mm256_and_si256(a.v, b.v)}; }
inline Ints operator|(Ints a, Ints b) { return {_mm256_or_si256(a.v, b.v)}; }
inline Ints operator^(Ints a, Ints b) { return {_mm256_xor_si256(a.v, b.v)}; }
inline Ints without(Ints a, Ints removed) { return {_mm256_andnot_si256(removed.v, a.v)}; }
template <int N>
inline Ints shift_left(Ints a) {
  return {_mm256_slli_epi32(a.v, N)};
}
template <int N>
inline Ints shift_right(Ints a) {
  return {_mm256_srai_epi32(a.v, N)};
}
inline Ints min(Ints a, Ints b) { return {_mm256_min_epi32(a.v, b.v)}; }
inline Ints max(Ints a, Ints b) { return {_mm256_max_epi32(a.v, b.v)}; }
inline Ints operator>(Ints a, Ints b) { return {_mm256_cmpgt_epi32(a.v, b.v)}; }
inline Ints operator==(Ints a, Ints b) { return {_mm256_cmpeq_epi32(a.v, b.v)}; }
inline Ints operator>(Floats a, Floats b) {
  return {_mm256_castps_si256(_mm256_cmp_ps(a.v, b.v, _CMP_GT_OQ))};
}
inline Floats as_float(Ints a) { return {_mm256_castsi256_ps(a.v)}; }
inline Ints as_int(Floats a) { return {_mm256_castps_si256(a.v)}; }
inline Floats select(Ints mask, Floats a, Floats b) {
  return {_mm256_blendv_ps(b.v, a.v, _mm256_castsi256_ps(mask.v))};
}
inline Ints select(Ints mask, Ints a, Ints b) {
  return as_int(select(mask, as_float(a), as_float(b)));
}
inline unsigned sign_bits(Ints a) {
  return static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(a.v)));
}
inline int32_t highest_lane(Ints a) {
  const __m128i four = _mm_max_epi32(_mm256_castsi256_si128(a.v), _mm256_extracti128_si256(a.v, 1));
  const __m128i two = _mm_max_epi32(four, _mm_shuffle_epi32(four, 0x4e));
  return _mm_cvtsi128_si32(_mm_max_epi32(two, _mm_shuffle_epi32(two, 0xb1)));
}
inline Floats to_float(Ints a) { return {_mm256_cvtepi32_ps(a.v)}; }
inline Ints round_to_int(Floats a) { return {_mm256_cvtps_epi32(a.v)}; }
inline Ints truncate_to_int(Floats a) { return {_mm256_cvttps_epi32(a.v)}; }

/// For each set of lanes, the lanes in order as bytes.
struct PackTable {
  alignas(64) uint64_t lanes[256];
  constexpr PackTable() : lanes{} {
    for (int bits = 0; bits < 256; ++bits) {
      int n = 0;
      for (uint64_t i = 0; i < 8; ++i)
        if (bits >> i & 1) lanes[bits] |= i << (8 * n++);
    }
  }
};
inline constexpr PackTable pack_table;

inline Ints pack_order(unsigned bits) {
  return {_mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i*)&pack_table.lanes[bits]))};
}
inline void store_packed(int32_t* p, Ints a, unsigned bits) {
  store(p, Ints{_mm256_permutevar8x32_epi32(a.v, pack_order(bits).v)});
}
inline void store_packed(float* p, Floats a, unsigned bits) {
  store(p, Floats{_mm256_permutevar8x32_ps(a.v, pack_order(bits).v)});
}
inline void store_packed_words(uint64_t* p, Ints high, Ints low, unsigned bits) {
  const __m256i order = pack_order(bits).v;
  const __m256i h = _mm256_permutevar8x32_epi32(high.v, order);
  const __m256i l = _mm256_permutevar8x32_epi32(low.v, order);
  const __m256i even = _mm256_unpacklo_epi32(l, h), odd = _mm256_unpackhi_epi32(l, h);
  _mm256_storeu_si256((__m256i*)p, _mm256_permute2x128_si256(even, odd, 0x20));
  _mm256_storeu_si256((__m256i*)(p + 4), _mm256_permute2x128_si256(even, odd, 0x31));
}

inline void load_rows3(const float* p, Floats& x, Floats& y, Floats& z) {
  const __m256 a = _mm256_loadu_ps(p), b = _mm256_loadu_ps(p + 8), c = _mm256_loadu_ps(p + 16);
  // a = x0 y0 z0 x1 y1 z1 x2 y2, b = z2 x3 y3 z3 x4 y4 z4 x5, c = y5 z5 x6 y6 z6 x7 y7 z7.
  const __m256 xs = _mm256_blend_ps(_mm256_blend_ps(a, b, 0x92), c, 0x24);
  const __m256 ys = _mm256_blend_ps(_mm256_blend_ps(a, b, 0x24), c, 0x49);
  const __m256 zs = _mm256_blend_ps(_mm256_blend_ps(a, b, 0x49), c, 0x92);
  x.v = _mm256_permutevar8x32_ps(xs, _mm256_setr_epi32(0, 3, 6, 1, 4, 7, 2, 5));
  y.v = _mm256_permutevar8x32_ps(ys, _mm256_setr_epi32(1, 4, 7, 2, 5, 0, 3, 6));
  z.v = _mm256_permutevar8x32_ps(zs, _mm256_setr_epi32(2, 5, 0, 3, 6, 1, 4, 7));
}

/// Within each 128-bit half: four vectors of four to their transpose.
inline void transpose4(__m256& a, __m256& b, __m256& c, __m256& d) {
  const __m256 ab0 = _mm256_unpacklo_ps(a, b), ab1 = _mm256_unpackhi_ps(a, b);
  const __m256 cd0 = _mm256_unpacklo_ps(c, d), cd1 = _mm256_unpackhi_ps(c, d);
  a = _mm256_shuffle_ps(ab0, cd0, 0x44);
  b = _mm256_shuffle_ps(ab0, cd0, 0xee);
  c = _mm256_shuffle_ps(ab1, cd1, 0x44);
  d = _mm256_shuffle_ps(ab1, cd1, 0xee);
}
inline void store_rows4(float* p, int stride_floats, Floats a, Floats b, Floats c, Floats d) {
  transpose4(a.v, b.v, c.v, d.v);  // rows 0|4, 1|5, 2|6, 3|7
  const __m256 rows[4] = {a.v, b.v, c.v, d.v};
  for (int i = 0; i < 4; ++i) _mm_storeu_ps(p + i * stride_floats, _mm256_castps256_ps128(rows[i]));
  for (int i = 0; i < 4; ++i)
    _mm_storeu_ps(p + (4 + i) * stride_floats, _mm256_extractf128_ps(rows[i], 1));
}
inline __m256 two_rows4(const float* base, int32_t low, int32_t high) {
  return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(base + 4 * int64_t{low})),
                              _mm_loadu_ps(base + 4 * int64_t{high}), 1);
}
inline void gather_rows4(const float* base, const int32_t* index, int stride, Floats& a, Floats& b,
                         Floats& c, Floats& d) {
  a.v = two_rows4(base, index[0], index[4 * stride]);
  b.v = two_rows4(base, index[stride], index[5 * stride]);
  c.v = two_rows4(base, index[2 * stride], index[6 * stride]);
  d.v = two_rows4(base, index[3 * stride], index[7 * stride]);
  transpose4(a.v, b.v, c.v, d.v);
}
inline void store_rows8(float* p, const Floats* columns) {
  __m256 a[4] = {columns[0].v, columns[1].v, columns[2].v, columns[3].v};
  __m256 b[4] = {columns[4].v, columns[5].v, columns[6].v, columns[7].v};
  transpose4(a[0], a[1], a[2], a[3]);
  transpose4(b[0], b[1], b[2], b[3]);
  for (int i = 0; i < 4; ++i) {
    _mm256_storeu_ps(p + 8 * i, _mm256_permute2f128_ps(a[i], b[i], 0x20));
    _mm256_storeu_ps(p + 8 * (i + 4), _mm256_permute2f128_ps(a[i], b[i], 0x31));
  }
}
inline void gather_rows8(const float* base, const int32_t* index, Floats* columns) {
  __m256 low[4], high[4];
  for (int i = 0; i < 4; ++i) {
    const float* first = base + 8 * int64_t{index[i]};
    const float* second = base + 8 * int64_t{index[i + 4]};
    low[i] =
        _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(first)), _mm_loadu_ps(second), 1);
    high[i] = _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(first + 4)),
                                   _mm_loadu_ps(second + 4), 1);
  }
  transpose4(low[0], low[1], low[2], low[3]);
  transpose4(high[0], high[1], high[2], high[3]);
  for (int i = 0; i < 4; ++i) columns[i].v = low[i], columns[i + 4].v = high[i];
}
inline void load_halves(const uint64_t* p, Ints& high, Ints& low) {
  const __m256 a = _mm256_loadu_ps((const float*)p), b = _mm256_loadu_ps((const float*)(p + 4));
  const __m256d even = _mm256_castps_pd(_mm256_shuffle_ps(a, b, 0x88));  // words 0 1 4 5 2 3 6 7
  const __m256d odd = _mm256_castps_pd(_mm256_shuffle_ps(a, b, 0xdd));
  low.v = _mm256_castpd_si256(_mm256_permute4x64_pd(even, 0xd8));
  high.v = _mm256_castpd_si256(_mm256_permute4x64_pd(odd, 0xd8));
}
inline void store_zeros(uint64_t* p) {
  _mm256_storeu_si256((__m256i*)p, _mm256_setzero_si256());
  _mm256_storeu_si256((__m256i*)(p + 4), _mm256_setzero_si256());
}
inline Floats gather(const float* base, Ints index) {
  return {_mm256_i32gather_ps(base, index.v, 4)};
}

}  // namespace semblance::avx2
