// SPDX-License-Identifier: Apache-2.0
// Transpose of a square of lane_count<T> x lane_count<T> values: row layout (lanes are rows of the image) to column layout and back.
#if defined(SIMSENSE_CPU_TRANSPOSE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_TRANSPOSE_INL_H_
#undef SIMSENSE_CPU_TRANSPOSE_INL_H_
#else
#define SIMSENSE_CPU_TRANSPOSE_INL_H_
#endif

#include "cpu/simd/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

template <class T>
HWY_INLINE void transpose(const T* from, size_t, T* to, size_t, size_t) {
  *to = *from;
}

#else

/// Transposes within 128-bit blocks of k values: value i of block b of v[j] moves to value j of block b of v[i], for j < k.
template <class T, size_t k>
HWY_INLINE void transpose_in_blocks(Vector<T>* v) {
  const Lanes<T> tag;
  Vector<T> w[k];
  for (size_t stage = 1; stage < k; stage *= 2) {  // perfect shuffles of rows i and i + k/2
    for (size_t i = 0; i < k / 2; ++i) {
      w[2 * i] = hn::InterleaveLower(tag, v[i], v[i + k / 2]);
      w[2 * i + 1] = hn::InterleaveUpper(tag, v[i], v[i + k / 2]);
    }
    for (size_t i = 0; i < k; ++i) v[i] = w[i];
  }
}

/// Transposes whole 128-bit blocks: block i of v[j] moves to block j of v[i].
template <class T, size_t blocks>
HWY_INLINE void transpose_blocks(Vector<T>* v) {
  const Lanes<T> tag;
  if constexpr (blocks == 2) {
    const auto lower = hn::ConcatLowerLower(tag, v[1], v[0]);
    v[1] = hn::ConcatUpperUpper(tag, v[1], v[0]);
    v[0] = lower;
  } else if constexpr (blocks == 4) {
    const auto a = hn::ConcatLowerLower(tag, v[2], v[0]), b = hn::ConcatLowerLower(tag, v[3], v[1]);
    const auto c = hn::ConcatUpperUpper(tag, v[2], v[0]), d = hn::ConcatUpperUpper(tag, v[3], v[1]);
    v[0] = hn::OddEvenBlocks(hn::SwapAdjacentBlocks(b), a);
    v[1] = hn::OddEvenBlocks(b, hn::SwapAdjacentBlocks(a));
    v[2] = hn::OddEvenBlocks(hn::SwapAdjacentBlocks(d), c);
    v[3] = hn::OddEvenBlocks(d, hn::SwapAdjacentBlocks(c));
  }
}

/// Transposes: to[j][i] = from[i][j] for j < row_count. `from` and `to` may be the same square. Pitches in elements, rows aligned to a
/// vector.
template <class T>
HWY_INLINE void transpose(const T* from, size_t from_pitch, T* to, size_t to_pitch, size_t row_count) {
  const Lanes<T> tag;
  constexpr size_t lanes = lane_count<T>, k = 16 / sizeof(T), blocks = lanes / k;
  HWY_ALIGN T partial[blocks * k * lanes];
  for (size_t g = 0; g < blocks; ++g) {
    Vector<T> v[k];
    for (size_t i = 0; i < k; ++i) v[i] = hn::Load(tag, from + (g * k + i) * from_pitch);
    transpose_in_blocks<T, k>(v);
    for (size_t i = 0; i < k; ++i) hn::Store(v[i], tag, partial + (g * k + i) * lanes);
  }
  for (size_t i = 0; i < k; ++i) {
    Vector<T> v[blocks];
    for (size_t g = 0; g < blocks; ++g) v[g] = hn::Load(tag, partial + (g * k + i) * lanes);
    transpose_blocks<T, blocks>(v);
    for (size_t b = 0; b < blocks; ++b) {
      if (b * k + i < row_count) hn::Store(v[b], tag, to + (b * k + i) * to_pitch);
    }
  }
}

#endif

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
