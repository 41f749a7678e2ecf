// SPDX-License-Identifier: Apache-2.0
// Speckle: light times a gamma factor (Goodman, Speckle Phenomena in Optics, 3.4), the quantile at the pixel's normal number.
#if defined(SIMSENSE_CPU_SIGNAL_SPECKLE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_SIGNAL_SPECKLE_INL_H_
#undef SIMSENSE_CPU_SIGNAL_SPECKLE_INL_H_
#else
#define SIMSENSE_CPU_SIGNAL_SPECKLE_INL_H_
#endif

#include "cpu/signal/pixel-inl.h"
#include "cpu/signal/rows.h"
#include "cpu/signal/words-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

/// Reads start and slope of the table's intervals at `count` indices. Scalar loads: gather instructions are slower on many CPUs.
HWY_INLINE void look_up(const GammaTable& table, const int32_t* index, size_t count, GammaTable::Interval* found) {
  for (size_t i = 0; i < count; ++i) found[i] = table.intervals()[index[i]];
}

/// Gamma quantiles of one vector of standard normals.
HWY_INLINE Floats gamma_of(const GammaTable& table, Floats normal) {
  const FloatTag tag;
  HWY_ALIGN int32_t index[hn::MaxLanes(FloatTag())];
  HWY_ALIGN GammaTable::Interval found[hn::MaxLanes(FloatTag())];
  constexpr float per_unit = GammaTable::interval_count / (GammaTable::z_max - GammaTable::z_min);
  const Floats place = hn::Mul(hn::Sub(normal, splat(GammaTable::z_min)), splat(per_unit));
  const Floats bounded = hn::Min(hn::Max(place, splat(0)), splat(GammaTable::interval_count));
  const Ints whole = hn::ConvertTo(IntTag(), bounded);
  hn::Store(whole, IntTag(), index);
  look_up(table, index, hn::Lanes(tag), found);
  Floats start, slope;
  hn::LoadInterleaved2(tag, &found[0].start, start, slope);
  const Floats root = hn::Add(start, hn::Mul(slope, hn::Sub(bounded, hn::ConvertTo(FloatTag(), whole))));
  return hn::Mul(hn::Mul(root, root), root);
}

/// Computes the row's factors of one part of the speckle; adds them unless it is the first part.
HWY_INLINE void gamma_row(const SignalRow& row, const SpeckleRow& part, const PhiloxKey& key, Dimension dimension, bool is_first) {
  const FloatTag tag;
  if (!part.normals) row_words(key, dimension, 0, row.y, row.width, row.words);
  for (size_t x = 0; x < row.width; x += hn::Lanes(tag)) {
    const Floats normal = part.normals ? hn::Load(tag, part.normals + x) : normal_of(uniform_of(hn::Load(WordTag(), row.words + x)));
    const Floats factor = gamma_of(*part.table, normal);
    hn::Store(is_first ? factor : hn::Add(factor, hn::Load(tag, row.scratch + x)), tag, row.scratch + x);
  }
}

/// Multiplies the row by speckle. Gamma variates of one scale add up to one of the summed shape: one part is static, the other drawn anew
/// in each frame.
HWY_INLINE void speckle_row(const SignalRow& row, const SpeckleRow& fixed, const SpeckleRow& temporal) {
  if (!fixed.table && !temporal.table) return;
  if (fixed.table) gamma_row(row, fixed, row.keys.scene, Dimension::speckle_static, true);
  if (temporal.table) gamma_row(row, temporal, row.keys.frame, Dimension::speckle_temporal, !fixed.table);
  const FloatTag tag;
  for (size_t x = 0; x < row.width; x += hn::Lanes(tag)) {
    const Floats light = hn::Load(tag, row.values + x), factor = hn::Load(tag, row.scratch + x);
    if (row.laser) {
      const Floats laser = hn::Max(hn::Min(exposed(row.signal, hn::Load(tag, row.laser + x)), light), splat(0));
      hn::Store(hn::Add(hn::Sub(light, laser), hn::Mul(laser, factor)), tag, row.values + x);
    } else {
      hn::Store(hn::Mul(light, factor), tag, row.values + x);
    }
  }
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
