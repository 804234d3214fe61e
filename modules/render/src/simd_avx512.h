// Sixteen lanes in AVX-512. See simd_portable.h for what each operation does. Only
// kernels_avx512.cc may include this.
#pragma once

#include <immintrin.h>
#include <stdint.h>

namespace semblance::avx512 {

constexpr int lanes = 16;
constexpr unsigned all_lanes = 0xffff;

struct Ints {
  __m512i v;
};
struct Floats {
  __m512 v;
};

inline Ints splat(int32_t a) { return {_mm512_set1_epi32(a)}; }
inline Floats splat(float a) { return {_mm512_set1_ps(a)}; }
inline Ints iota() {
  return {_mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)};
}
inline Ints load(const int32_t* p) { return {_mm512_loadu_si512(p)}; }
inline Floats load(const float* p) { return {_mm512_loadu_ps(p)}; }
inline void store(int32_t* p, Ints a) { _mm512_storeu_si512(p, a.v); }
inline void store(float* p, Floats a) { _mm512_storeu_ps(p, a.v); }

inline Floats operator+(Floats a, Floats b) { return {_mm512_add_ps(a.v, b.v)}; }
inline Floats operator-(Floats a, Floats b) { return {_mm512_sub_ps(a.v, b.v)}; }
inline Floats operator*(Floats a, Floats b) { return {_mm512_mul_ps(a.v, b.v)}; }
inline Floats operator/(Floats a, Floats b) { return {_mm512_div_ps(a.v, b.v)}; }
inline Floats min(Floats a, Floats b) { return {_mm512_min_ps(a.v, b.v)}; }
inline Floats max(Floats a, Floats b) { return {_mm512_max_ps(a.v, b.v)}; }
inline Floats square_root(Floats a) { return {_mm512_sqrt_ps(a.v)}; }
inline Ints operator+(Ints a, Ints b) { return {_mm512_add_epi32(a.v, b.v)}; }
inline Ints operator-(Ints a, Ints b) { return {_mm512_sub_epi32(a.v, b.v)}; }
inline Ints operator*(Ints a, Ints b) { return {_mm512_mullo_epi32(a.v, b.v)}; }
inline Ints operator&(Ints a, Ints b) { return {_mm512_and_si512(a.v, b.v)}; }
inline Ints operator|(Ints a, Ints b) { return {_mm512_or_si512(a.v, b.v)}; }
inline Ints operator^(Ints a, Ints b) { return {_mm512_xor_si512(a.v, b.v)}; }
inline Ints without(Ints a, Ints removed) { return {_mm512_andnot_si512(removed.v, a.v)}; }
template <int N>
inline Ints shift_left(Ints a) {
  return {_mm512_slli_epi32(a.v, N)};
}
template <int N>
inline Ints shift_right(Ints a) {
  return {_mm512_srai_epi32(a.v, N)};
}
inline Ints min(Ints a, Ints b) { return {_mm512_min_epi32(a.v, b.v)}; }
inline Ints max(Ints a, Ints b) { return {_mm512_max_epi32(a.v, b.v)}; }
inline Ints operator>(Ints a, Ints b) {
  return {_mm512_movm_epi32(_mm512_cmpgt_epi32_mask(a.v, b.v))};
}
inline Ints operator==(Ints a, Ints b) {
  return {_mm512_movm_epi32(_mm512_cmpeq_epi32_mask(a.v, b.v))};
}
inline Ints operator>(Floats a, Floats b) {
  return {_mm512_movm_epi32(_mm512_cmp_ps_mask(a.v, b.v, _CMP_GT_OQ))};
}
inline Floats as_float(Ints a) { return {_mm512_castsi512_ps(a.v)}; }
inline Ints as_int(Floats a) { return {_mm512_castps_si512(a.v)}; }
inline unsigned sign_bits(Ints a) { return _mm512_movepi32_mask(a.v); }
inline Floats select(Ints mask, Floats a, Floats b) {
  return {_mm512_mask_blend_ps(_mm512_movepi32_mask(mask.v), b.v, a.v)};
}
inline Ints select(Ints mask, Ints a, Ints b) {
  return {_mm512_mask_blend_epi32(_mm512_movepi32_mask(mask.v), b.v, a.v)};
}
inline int32_t highest_lane(Ints a) { return _mm512_reduce_max_epi32(a.v); }
inline Floats to_float(Ints a) { return {_mm512_cvtepi32_ps(a.v)}; }
inline Ints round_to_int(Floats a) { return {_mm512_cvtps_epi32(a.v)}; }
inline Ints truncate_to_int(Floats a) { return {_mm512_cvttps_epi32(a.v)}; }

inline void store_packed(int32_t* p, Ints a, unsigned bits) {
  store(p, Ints{_mm512_maskz_compress_epi32(static_cast<__mmask16>(bits), a.v)});
}
inline void store_packed(float* p, Floats a, unsigned bits) {
  store(p, Floats{_mm512_maskz_compress_ps(static_cast<__mmask16>(bits), a.v)});
}
inline void store_packed_words(uint64_t* p, Ints high, Ints low, unsigned bits) {
  const auto chosen = static_cast<__mmask16>(bits);
  const __m512i h = _mm512_maskz_compress_epi32(chosen, high.v);
  const __m512i l = _mm512_maskz_compress_epi32(chosen, low.v);
  const __m512i first = _mm512_setr_epi32(0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
  const __m512i last = _mm512_add_epi32(first, _mm512_set1_epi32(8));
  _mm512_storeu_si512(p, _mm512_permutex2var_epi32(l, first, h));
  _mm512_storeu_si512(p + 8, _mm512_permutex2var_epi32(l, last, h));
}

/// Every third of 48 numbers from the first, second or third on: those of a and b, then those of c.
inline __m512 every_third(__m512 a, __m512 b, __m512 c, __m512i of_a_and_b, __mmask16 in_c,
                          __m512i of_c) {
  return _mm512_mask_permutexvar_ps(_mm512_permutex2var_ps(a, of_a_and_b, b), in_c, of_c, c);
}
inline void load_rows3(const float* p, Floats& x, Floats& y, Floats& z) {
  const __m512 a = _mm512_loadu_ps(p), b = _mm512_loadu_ps(p + 16), c = _mm512_loadu_ps(p + 32);
  const __m512i first =
      _mm512_setr_epi32(0, 3, 6, 9, 12, 15, 18, 21, 24, 27, 30, 33, 36, 39, 42, 45);
  const __m512i one = _mm512_set1_epi32(1), skip = _mm512_set1_epi32(32);
  const __m512i second = _mm512_add_epi32(first, one), third = _mm512_add_epi32(second, one);
  x.v = every_third(a, b, c, first, 0xf800, _mm512_sub_epi32(first, skip));
  y.v = every_third(a, b, c, second, 0xf800, _mm512_sub_epi32(second, skip));
  z.v = every_third(a, b, c, third, 0xfc00, _mm512_sub_epi32(third, skip));
}

/// Within each 128-bit quarter: four vectors of four to their transpose.
inline void transpose4(__m512& a, __m512& b, __m512& c, __m512& d) {
  const __m512 ab0 = _mm512_unpacklo_ps(a, b), ab1 = _mm512_unpackhi_ps(a, b);
  const __m512 cd0 = _mm512_unpacklo_ps(c, d), cd1 = _mm512_unpackhi_ps(c, d);
  a = _mm512_shuffle_ps(ab0, cd0, 0x44);
  b = _mm512_shuffle_ps(ab0, cd0, 0xee);
  c = _mm512_shuffle_ps(ab1, cd1, 0x44);
  d = _mm512_shuffle_ps(ab1, cd1, 0xee);
}
inline void store_rows4(float* p, int stride_floats, Floats a, Floats b, Floats c, Floats d) {
  transpose4(a.v, b.v, c.v, d.v);  // rows 0|4|8|12, 1|5|9|13, 2|6|10|14, 3|7|11|15
  const __m512 rows[4] = {a.v, b.v, c.v, d.v};
  for (int i = 0; i < 4; ++i) _mm_storeu_ps(p + i * stride_floats, _mm512_castps512_ps128(rows[i]));
  for (int i = 0; i < 4; ++i)
    _mm_storeu_ps(p + (4 + i) * stride_floats, _mm512_extractf32x4_ps(rows[i], 1));
  for (int i = 0; i < 4; ++i)
    _mm_storeu_ps(p + (8 + i) * stride_floats, _mm512_extractf32x4_ps(rows[i], 2));
  for (int i = 0; i < 4; ++i)
    _mm_storeu_ps(p + (12 + i) * stride_floats, _mm512_extractf32x4_ps(rows[i], 3));
}
/// Four rows of four floats at p[0], p[4], p[8] and p[12].
inline __m512 join_rows4(const float* const* p) {
  const __m256 low =
      _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(p[0])), _mm_loadu_ps(p[4]), 1);
  const __m256 high =
      _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(p[8])), _mm_loadu_ps(p[12]), 1);
  return _mm512_insertf32x8(_mm512_castps256_ps512(low), high, 1);
}
inline void gather_rows4(const float* base, const int32_t* index, int stride, Floats& a, Floats& b,
                         Floats& c, Floats& d) {
  const float* rows[lanes];
  for (int i = 0; i < lanes; ++i) rows[i] = base + 4 * int64_t{index[i * stride]};
  a.v = join_rows4(rows), b.v = join_rows4(rows + 1);
  c.v = join_rows4(rows + 2), d.v = join_rows4(rows + 3);
  transpose4(a.v, b.v, c.v, d.v);
}
inline void store_rows8(float* p, const Floats* columns) {
  store_rows4(p, 8, columns[0], columns[1], columns[2], columns[3]);
  store_rows4(p + 4, 8, columns[4], columns[5], columns[6], columns[7]);
}
inline void gather_rows8(const float* base, const int32_t* index, Floats* columns) {
  const auto two_rows = [&](int i) {  // i and i + 4
    return _mm512_insertf32x8(_mm512_castps256_ps512(_mm256_loadu_ps(base + 8 * int64_t{index[i]})),
                              _mm256_loadu_ps(base + 8 * int64_t{index[i + 4]}), 1);
  };
  for (int i = 0; i < 4; ++i) {  // first and last four columns of rows i, i + 4, i + 8, i + 12
    const __m512 low = two_rows(i), high = two_rows(i + 8);
    columns[i].v = _mm512_shuffle_f32x4(low, high, 0x88);
    columns[i + 4].v = _mm512_shuffle_f32x4(low, high, 0xdd);
  }
  transpose4(columns[0].v, columns[1].v, columns[2].v, columns[3].v);
  transpose4(columns[4].v, columns[5].v, columns[6].v, columns[7].v);
}
inline void load_halves(const uint64_t* p, Ints& high, Ints& low) {
  const __m512i a = _mm512_loadu_si512(p), b = _mm512_loadu_si512(p + 8);
  const __m512i even = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
  low.v = _mm512_permutex2var_epi32(a, even, b);
  high.v = _mm512_permutex2var_epi32(a, _mm512_add_epi32(even, _mm512_set1_epi32(1)), b);
}
inline void store_zeros(uint64_t* p) {
  _mm512_storeu_si512(p, _mm512_setzero_si512());
  _mm512_storeu_si512(p + 8, _mm512_setzero_si512());
}
inline Floats gather(const float* base, Ints index) {
  return {_mm512_i32gather_ps(index.v, base, 4)};
}

}  // namespace semblance::avx512
