// SPDX-License-Identifier: Apache-2.0
// Shot noise: the Poisson quantile of the mean charge at the pixel's uniform number.
#if defined(SIMSENSE_CPU_SIGNAL_SHOT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_SIGNAL_SHOT_INL_H_
#undef SIMSENSE_CPU_SIGNAL_SHOT_INL_H_
#else
#define SIMSENSE_CPU_SIGNAL_SHOT_INL_H_
#endif

#include "cpu/signal/passes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

/// From this mean on the asymptotic expansion replaces the sum; it misses the quantile by one electron in 5e-4 of draws here, and less
/// above.
constexpr float poisson_sum_below_e = 10;

/// The quantile's normal asymptotic expansion (Giles, Algorithm 955: approximation of the inverse Poisson CDF, ACM TOMS 42(1), 2016).
HWY_INLINE Floats poisson_expansion(Floats mean, Floats z) {
  const Floats bounded = hn::Max(mean, splat(poisson_sum_below_e)), z2 = hn::Mul(z, z);
  const Floats root = hn::Sqrt(bounded);
  const Floats order0 = polynomial(z2, 1.0f / 6, 1.0f / 3);
  const Floats order1 = hn::Mul(z, polynomial(z2, -1.0f / 72, -1.0f / 36));
  const Floats order2 = polynomial(z2, 1.0f / 270, 7.0f / 810, -8.0f / 405);
  const Floats small = hn::Div(hn::Add(order1, hn::Div(order2, root)), root);
  return hn::Floor(hn::Add(bounded, hn::Add(hn::Mul(root, z), hn::Add(order0, small))));
}

/// The smallest n whose cumulated probability reaches the uniform number. Terms below 1e-9 end the sum.
HWY_INLINE Floats poisson_sum(Floats mean, const Uniform& u) {
  const Floats target = hn::IfThenElse(u.low, u.tail, hn::Add(splat(0.5f), u.centre));
  Floats term = exponential(hn::Neg(mean)), sum = term, n = splat(0);
  for (float next = 1;; ++next) {
    const FloatMask open = hn::And(hn::Gt(target, sum), hn::Gt(term, splat(1e-9f)));
    if (hn::AllFalse(FloatTag(), open)) return n;
    n = hn::IfThenElse(open, splat(next), n);
    term = hn::Mul(term, hn::Div(mean, splat(next)));
    sum = hn::Add(sum, term);
  }
}

/// A Poisson variate of this mean; 0 for a mean of 0.
HWY_INLINE Floats poisson_of(Floats mean, Words word) {
  const Uniform u = uniform_of(word);
  const FloatMask positive = hn::Gt(mean, splat(0)), few = hn::And(positive, hn::Lt(mean, splat(poisson_sum_below_e)));
  Floats count = poisson_expansion(mean, normal_of(u));
  if (!hn::AllFalse(FloatTag(), few)) count = hn::IfThenElse(few, poisson_sum(hn::IfThenElseZero(few, mean), u), count);
  return hn::IfThenElse(positive, count, mean);
}

HWY_INLINE void shot_row(const SignalRow& row) {
  const float amount = row.signal.shot_noise;
  if (amount == 0) return;
  map_row_random(row, row.keys.frame, Dimension::shot, row.y, [=](Floats mean, Words word) {
    const Floats count = poisson_of(mean, word);
    return hn::Add(hn::Mul(count, splat(amount)), hn::Mul(mean, splat(1 - amount)));
  });
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
