// SPDX-License-Identifier: Apache-2.0
// Elementary functions and random words in vectors, of IEEE's basic operations alone: with contraction off (see CMakeLists.txt) every
// instruction set gives the same bits.
#if defined(SIMSENSE_CPU_SIGNAL_MATH_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_SIGNAL_MATH_INL_H_
#undef SIMSENSE_CPU_SIGNAL_MATH_INL_H_
#else
#define SIMSENSE_CPU_SIGNAL_MATH_INL_H_
#endif

#include <cstdint>

#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using FloatTag = hn::CappedTag<float, 16>;
using IntTag = hn::RebindToSigned<FloatTag>;
using WordTag = hn::RebindToUnsigned<FloatTag>;
using Floats = hn::Vec<FloatTag>;
using Ints = hn::Vec<IntTag>;
using Words = hn::Vec<WordTag>;
using FloatMask = hn::Mask<FloatTag>;

HWY_INLINE Floats splat(float value) { return hn::Set(FloatTag(), value); }
HWY_INLINE Ints splat_int(int32_t value) { return hn::Set(IntTag(), value); }
HWY_INLINE Floats mul_add(Floats a, Floats b, float c) { return hn::Add(hn::Mul(a, b), splat(c)); }

/// Evaluates a polynomial by Horner's rule; the coefficient of the highest power comes first.
template <class... Rest>
HWY_INLINE Floats polynomial(Floats x, float highest, Rest... rest) {
  Floats sum = splat(highest);
  ((sum = mul_add(sum, x, rest)), ...);
  return sum;
}

/// ln x of positive normal numbers, relative error 3e-7 off x = 1: 2 artanh((m - 1) / (m + 1)) of the mantissa m in [sqrt(1/2), sqrt(2)).
HWY_INLINE Floats natural_log(Floats x) {
  constexpr int32_t root_half_bits = 0x3F3504F3;
  const Ints bits = hn::BitCast(IntTag(), x);
  const Ints exponent = hn::ShiftRight<23>(hn::Sub(bits, splat_int(root_half_bits)));
  const Floats m = hn::BitCast(FloatTag(), hn::Sub(bits, hn::ShiftLeft<23>(exponent)));
  const Floats s = hn::Div(hn::Sub(m, splat(1)), hn::Add(m, splat(1)));
  const Floats series = polynomial(hn::Mul(s, s), 2.0f / 9, 2.0f / 7, 2.0f / 5, 2.0f / 3, 2.0f);
  return hn::Add(hn::Mul(hn::ConvertTo(FloatTag(), exponent), splat(0.693147181f)), hn::Mul(s, series));
}

/// e^x, with x clamped to -87..88; relative error 2e-7. It is 2^n times the Taylor series of the rest of x.
HWY_INLINE Floats exponential(Floats x) {
  x = hn::Min(hn::Max(x, splat(-87)), splat(88));
  const Ints n = hn::NearestInt(hn::Mul(x, splat(1.44269504f)));
  const Floats whole = hn::ConvertTo(FloatTag(), n);
  // ln 2 in two parts, the first short enough for an exact product.
  const Floats rest = hn::Sub(hn::Sub(x, hn::Mul(whole, splat(0.693359375f))), hn::Mul(whole, splat(-2.12194440e-4f)));
  const Floats series = polynomial(rest, 1.0f / 5040, 1.0f / 720, 1.0f / 120, 1.0f / 24, 1.0f / 6, 0.5f, 1.0f, 1.0f);
  return hn::Mul(series, hn::BitCast(FloatTag(), hn::ShiftLeft<23>(hn::Add(n, splat_int(127)))));
}

/// The uniform number (word + 1/2) / 2^32, as its distances from 1/2 and from the nearer end, each to full precision.
struct Uniform {
  FloatMask low;        // below 1/2
  Floats centre, tail;  // > 0; their sum is 1/2
};

HWY_INLINE Uniform uniform_of(Words word) {
  const Ints centred = hn::BitCast(IntTag(), hn::Xor(word, hn::Set(WordTag(), 0x80000000u)));
  const Ints distance = hn::Xor(centred, hn::ShiftRight<31>(centred));
  const auto scaled = [](Ints n) { return hn::Mul(hn::Add(hn::ConvertTo(FloatTag(), n), splat(0.5f)), splat(0x1p-32f)); };
  return {hn::RebindMask(FloatTag(), hn::Lt(centred, hn::Zero(IntTag()))), scaled(distance),
          scaled(hn::Sub(splat_int(0x7FFFFFFF), distance))};
}

/// The standard normal quantile, absolute error 2e-6: algorithm AS 241, PPND7 (Wichura, Applied Statistics 37(3), 1988). Its third case,
/// the far tail, is left out: no word comes near it.
HWY_INLINE Floats normal_of(const Uniform& u) {
  const Floats centre_r = hn::Sub(splat(0.180625f), hn::Mul(u.centre, u.centre));
  const Floats centre_top = hn::Mul(u.centre, polynomial(centre_r, 59.109374720f, 159.29113202f, 50.434271938f, 3.3871327179f));
  const Floats centre_bottom = polynomial(centre_r, 67.187563600f, 78.757757664f, 17.895169469f, 1.0f);
  const Floats tail_r = hn::Sub(hn::Sqrt(hn::Neg(natural_log(u.tail))), splat(1.6f));
  const Floats tail_top = polynomial(tail_r, 0.17023821103f, 1.3067284816f, 2.7568153900f, 1.4234372777f);
  const Floats tail_bottom = polynomial(tail_r, 0.12021132975f, 0.73700164250f, 1.0f);
  const FloatMask is_centre = hn::Le(u.centre, splat(0.425f));
  const Floats top = hn::IfThenElse(is_centre, centre_top, tail_top), bottom = hn::IfThenElse(is_centre, centre_bottom, tail_bottom);
  const Floats magnitude = hn::Div(top, bottom);
  return hn::IfThenElse(u.low, hn::Neg(magnitude), magnitude);
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
