// SPDX-License-Identifier: Apache-2.0
// From light to mean charge: exposure, photo-response non-uniformity, dark charge and hot pixels.
#if defined(SIMSENSE_CPU_SIGNAL_PIXEL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_SIGNAL_PIXEL_INL_H_
#undef SIMSENSE_CPU_SIGNAL_PIXEL_INL_H_
#else
#define SIMSENSE_CPU_SIGNAL_PIXEL_INL_H_
#endif

#include "cpu/signal/passes-inl.h"
#include "signal/imager.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

/// Far beyond any sensor, and far from where arithmetic overflows.
constexpr float largest_charge_e = 1e30f;

/// Converts light to electrons; NaN reads as 0.
HWY_INLINE Floats exposed(const simsense_signal& signal, Floats light) {
  const Floats electrons = splat(signal.responsivity_e * signal.exposure_s);
  const Floats number = hn::IfThenElseZero(hn::Eq(light, light), light);
  return hn::Max(hn::Min(hn::Mul(number, electrons), splat(largest_charge_e)), splat(-largest_charge_e));
}

HWY_INLINE void exposure_row(const SignalRow& row) {
  map_row(row, [&](Floats light) { return exposed(row.signal, light); });
}

HWY_INLINE void prnu_row(const SignalRow& row) {
  const float prnu = row.signal.prnu;
  if (prnu == 0) return;
  map_row_random(row, row.keys.sensor, Dimension::prnu, row.y, [=](Floats charge, Words word) {
    const Floats response = hn::Add(splat(1), hn::Mul(normal_of(uniform_of(word)), splat(prnu)));
    return hn::Mul(charge, hn::Max(response, splat(0)));
  });
}

/// Adds charge to hot pixels, those whose uniform number is below the share. -ln(number / share) is their exponential strength.
HWY_INLINE void hot_pixel_row(const SignalRow& row, float mean_e) {
  const float share = row.signal.hot_pixel_share;
  if (share == 0 || mean_e == 0) return;
  map_row_random(row, row.keys.sensor, Dimension::hot_pixel, row.y, [=](Floats charge, Words word) {
    const Uniform u = uniform_of(word);
    const FloatMask hot = hn::And(u.low, hn::Lt(u.tail, splat(share)));
    const Floats strength = hn::Neg(natural_log(hn::Mul(u.tail, splat(1 / share))));
    return hn::Add(charge, hn::IfThenElseZero(hot, hn::Mul(strength, splat(mean_e))));
  });
}

HWY_INLINE void dark_row(const SignalRow& row) {
  const float seconds = dark_exposure_s(row.signal), dark_e = row.signal.dark_current_e_per_s * seconds;
  if (dark_e != 0) map_row(row, [=](Floats charge) { return hn::Add(charge, splat(dark_e)); });
  hot_pixel_row(row, row.signal.hot_pixel_e_per_s * seconds);
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
