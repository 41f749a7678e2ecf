// SPDX-License-Identifier: Apache-2.0
// Analogue DN to counts: converter noise, black level, rounding and the range of the bit depth.
#if defined(SIMSENSE_CPU_SIGNAL_CONVERTER_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_SIGNAL_CONVERTER_INL_H_
#undef SIMSENSE_CPU_SIGNAL_CONVERTER_INL_H_
#else
#define SIMSENSE_CPU_SIGNAL_CONVERTER_INL_H_
#endif

#include <type_traits>

#include "cpu/signal/passes-inl.h"
#include "signal/imager.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

template <class Count>
HWY_INLINE void converter_row(const SignalRow& row, float max_dn, Count* counts) {
  add_normals(row, row.keys.frame, Dimension::adc, row.y, row.signal.adc_noise_dn);
  const Floats black = splat(black_dn(row.signal)), highest = splat(max_dn);
  const FloatTag tag;
  const hn::Rebind<Count, FloatTag> count_tag;
  for (size_t x = 0; x < row.width; x += hn::Lanes(tag)) {
    const Floats dn = hn::Add(hn::Load(tag, row.values + x), black);
    if constexpr (std::is_same_v<Count, float>) {
      hn::StoreU(dn, tag, counts + x);
    } else {
      const Floats bounded = hn::Min(hn::Max(dn, splat(0)), highest);
      hn::StoreU(hn::DemoteTo(count_tag, hn::NearestInt(bounded)), count_tag, counts + x);
    }
  }
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
