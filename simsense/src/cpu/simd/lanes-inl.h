// SPDX-License-Identifier: Apache-2.0
// Vector types of the aggregation and the few operations that differ between 8, 16 and 32 bit lanes.
#if defined(SIMSENSE_CPU_LANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_LANES_INL_H_
#undef SIMSENSE_CPU_LANES_INL_H_
#else
#define SIMSENSE_CPU_LANES_INL_H_
#endif

#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <class T>
using Lanes = hn::CappedTag<T, 64 / sizeof(T)>;
template <class T>
using Vector = hn::Vec<Lanes<T>>;
template <class T>
constexpr size_t lane_count = hn::MaxLanes(Lanes<T>());

/// A value above every path cost, even with a penalty added.
template <class T>
constexpr T unreachable = sizeof(T) < 4 ? hwy::LimitsMax<T>() : T{1} << 30;

/// a + b, without wrapping if an operand is unreachable.
template <class V>
HWY_INLINE V add_bounded(V a, V b) {
  if constexpr (sizeof(hn::TFromV<V>) < 4) {
    return hn::SaturatedAdd(a, b);
  } else {
    return hn::Add(a, b);
  }
}

/// floor((a + b) / 4). In 8 bits the sum would overflow, so this takes the rounded-up mean and subtracts the rounding.
template <class V>
HWY_INLINE V quarter_sum(V a, V b) {
  if constexpr (sizeof(hn::TFromV<V>) == 1) {
    const auto half = hn::Sub(hn::AverageRound(a, b), hn::And(hn::Xor(a, b), hn::Set(hn::DFromV<V>(), 1)));
    return hn::ShiftRight<1>(half);
  } else {
    return hn::ShiftRight<2>(hn::Add(a, b));
  }
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
