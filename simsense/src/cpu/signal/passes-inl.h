// SPDX-License-Identifier: Apache-2.0
// The imager's basic step: one pass over a row, with or without a random number per pixel.
#if defined(SIMSENSE_CPU_SIGNAL_PASSES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_SIGNAL_PASSES_INL_H_
#undef SIMSENSE_CPU_SIGNAL_PASSES_INL_H_
#else
#define SIMSENSE_CPU_SIGNAL_PASSES_INL_H_
#endif

#include "cpu/signal/rows.h"
#include "cpu/signal/words-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

/// Sets value = f(value) for each pixel of the row.
template <class F>
HWY_INLINE void map_row(const SignalRow& row, F&& f) {
  const FloatTag tag;
  for (size_t x = 0; x < row.width; x += hn::Lanes(tag)) hn::Store(f(hn::Load(tag, row.values + x)), tag, row.values + x);
}

/// Sets value = f(value, word) for each pixel, with its random word of this dimension.
template <class F>
HWY_INLINE void map_row_random(const SignalRow& row, const PhiloxKey& key, Dimension dimension, uint32_t y, F&& f) {
  const FloatTag tag;
  row_words(key, dimension, 0, y, row.width, row.words);
  for (size_t x = 0; x < row.width; x += hn::Lanes(tag))
    hn::Store(f(hn::Load(tag, row.values + x), hn::Load(WordTag(), row.words + x)), tag, row.values + x);
}

/// Adds sigma * N(0, 1) to each pixel, a draw per column at the given y.
HWY_INLINE void add_normals(const SignalRow& row, const PhiloxKey& key, Dimension dimension, uint32_t y, float sigma) {
  if (sigma == 0) return;
  map_row_random(row, key, dimension, y,
                 [=](Floats value, Words word) { return hn::Add(value, hn::Mul(normal_of(uniform_of(word)), splat(sigma))); });
}

/// Adds sigma * N(0, 1) to each pixel, the same draw for the whole row.
HWY_INLINE void add_row_normal(const SignalRow& row, const PhiloxKey& key, Dimension dimension, float sigma) {
  if (sigma == 0) return;
  const Words word = hn::Set(WordTag(), pixel_word(key, dimension, 0, row.y));
  const Floats offset = hn::Mul(normal_of(uniform_of(word)), splat(sigma));
  map_row(row, [=](Floats value) { return hn::Add(value, offset); });
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
