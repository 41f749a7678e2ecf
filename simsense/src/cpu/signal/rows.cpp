// SPDX-License-Identifier: Apache-2.0
#include "cpu/signal/rows.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cpu/signal/rows.cpp"
#include "cpu/simd/targets.h"
// after targets.h
#include "cpu/signal/converter-inl.h"
#include "cpu/signal/pixel-inl.h"
#include "cpu/signal/readout-inl.h"
#include "cpu/signal/shot-inl.h"
#include "cpu/signal/speckle-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

void collect(const SignalRow& row, const SpeckleRow& static_speckle, const SpeckleRow& temporal_speckle) {
  exposure_row(row);
  speckle_row(row, static_speckle, temporal_speckle);
  prnu_row(row);
  dark_row(row);
  shot_row(row);
}

template <class Count>
HWY_INLINE void read_out(const SignalRow& row, Count* counts) {
  full_well_row(row);
  readout_noise_row(row);
  amplifier_row(row);
  response_row(row, max_dn(row.signal));
  converter_row(row, max_dn(row.signal), counts);
}

void read_out_8(const SignalRow& row, uint8_t* counts) { read_out(row, counts); }
void read_out_16(const SignalRow& row, uint16_t* counts) { read_out(row, counts); }
void read_out_analogue(const SignalRow& row, float* counts) { read_out(row, counts); }

void draw_normals(const PhiloxKey& key, Dimension dimension, int32_t x0, uint32_t y, size_t width, uint32_t* words, float* normals) {
  row_words(key, dimension, x0, y, width, words);
  for (size_t x = 0; x < width; x += hn::Lanes(FloatTag()))
    hn::Store(normal_of(uniform_of(hn::Load(WordTag(), words + x))), FloatTag(), normals + x);
}

void weigh(const float* values, size_t step, const float* weights, size_t weight_count, size_t width, float* sums) {
  for (size_t x = 0; x < width; x += hn::Lanes(FloatTag())) {
    Floats sum = splat(0);
    for (size_t k = 0; k < weight_count; ++k) sum = hn::Add(sum, hn::Mul(hn::LoadU(FloatTag(), values + k * step + x), splat(weights[k])));
    hn::Store(sum, FloatTag(), sums + x);
  }
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace simsense::cpu {

HWY_EXPORT(collect);
HWY_EXPORT(read_out_8);
HWY_EXPORT(read_out_16);
HWY_EXPORT(read_out_analogue);
HWY_EXPORT(draw_normals);
HWY_EXPORT(weigh);

void collect_row(const SignalRow& row, const SpeckleRow& static_speckle, const SpeckleRow& temporal_speckle) {
  HWY_DYNAMIC_DISPATCH(collect)(row, static_speckle, temporal_speckle);
}

void read_out_row(const SignalRow& row, uint8_t* counts) { HWY_DYNAMIC_DISPATCH(read_out_8)(row, counts); }
void read_out_row(const SignalRow& row, uint16_t* counts) { HWY_DYNAMIC_DISPATCH(read_out_16)(row, counts); }

void read_out_row(const SignalRow& row, float* counts) { HWY_DYNAMIC_DISPATCH(read_out_analogue)(row, counts); }

void normal_row(const PhiloxKey& key, Dimension dimension, int32_t x0, uint32_t y, size_t width, uint32_t* words, float* normals) {
  HWY_DYNAMIC_DISPATCH(draw_normals)(key, dimension, x0, y, width, words, normals);
}

void weigh_row(const float* values, size_t step, const float* weights, size_t weight_count, size_t width, float* sums) {
  HWY_DYNAMIC_DISPATCH(weigh)(values, step, weights, weight_count, width, sums);
}

}  // namespace simsense::cpu
#endif
