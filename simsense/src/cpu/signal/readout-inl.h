// SPDX-License-Identifier: Apache-2.0
// From charge to analogue DN: full well, fixed and temporal noise of pixels, rows and columns, the amplifier, the response curve.
#if defined(SIMSENSE_CPU_SIGNAL_READOUT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_SIGNAL_READOUT_INL_H_
#undef SIMSENSE_CPU_SIGNAL_READOUT_INL_H_
#else
#define SIMSENSE_CPU_SIGNAL_READOUT_INL_H_
#endif

#include "cpu/signal/passes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

/// Clips charge at the full well.
HWY_INLINE void full_well_row(const SignalRow& row) {
  const float full_well = row.signal.full_well_e;
  if (full_well > 0) map_row(row, [=](Floats charge) { return hn::Min(charge, splat(full_well)); });
}

HWY_INLINE void readout_noise_row(const SignalRow& row) {
  const simsense_signal& s = row.signal;
  add_normals(row, row.keys.sensor, Dimension::dsnu, row.y, s.dsnu_e);
  add_row_normal(row, row.keys.sensor, Dimension::row_fixed, s.row_fixed_e);
  add_normals(row, row.keys.sensor, Dimension::column_fixed, 0, s.column_fixed_e);
  add_row_normal(row, row.keys.frame, Dimension::row_temporal, s.row_noise_e);
  add_normals(row, row.keys.frame, Dimension::column_temporal, 0, s.column_noise_e);
  add_normals(row, row.keys.frame, Dimension::read, row.y, s.read_noise_e);
}

HWY_INLINE void amplifier_row(const SignalRow& row) {
  const float dn_per_e = row.signal.conversion_gain_dn_per_e * row.signal.gain;
  if (dn_per_e != 1) map_row(row, [=](Floats charge) { return hn::Mul(charge, splat(dn_per_e)); });
}

/// Applies the response's power law. It is odd about 0, so that noise in the dark keeps its mean, and keeps full scale. Values above four
/// times full scale are cut first; clipping hides that.
HWY_INLINE void response_row(const SignalRow& row, float max_dn) {
  const float exponent = row.signal.response_exponent;
  if (exponent == 1) return;
  constexpr float smallest = 1e-30f, largest = 4;
  map_row(row, [=](Floats dn) {
    const Floats relative = hn::Min(hn::Mul(hn::Abs(dn), splat(1 / max_dn)), splat(largest));
    const Floats power = exponential(hn::Mul(splat(exponent), natural_log(hn::Max(relative, splat(smallest)))));
    const Floats magnitude = hn::IfThenElseZero(hn::Gt(relative, splat(smallest)), hn::Mul(power, splat(max_dn)));
    return hn::CopySign(magnitude, dn);
  });
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
