// From a row's winners to disparities: uniqueness, subpixel parabola, left-right check. Lanes are pixels, float.
#if defined(SIMSENSE_CPU_SUBPIXEL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_SUBPIXEL_INL_H_
#undef SIMSENSE_CPU_SUBPIXEL_INL_H_
#else
#define SIMSENSE_CPU_SUBPIXEL_INL_H_
#endif

#include "cpu/winner-inl.h"
#include "matcher.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

using Floats = hn::CappedTag<float, 16>;
using Ints = hn::RebindToSigned<Floats>;

template <class T>
HWY_INLINE hn::Vec<Ints> load_ints(const T* values) {
  if constexpr (sizeof(T) == 4) {
    return hn::BitCast(Ints(), hn::LoadU(hn::Rebind<T, Floats>(), values));
  } else {
    return hn::PromoteTo(Ints(), hn::LoadU(hn::Rebind<T, Floats>(), values));
  }
}

/// Winner plus the vertex of the parabola through it and its neighbours; the winner itself at d = 0, at the last d and where the parabola
/// is flat.
HWY_INLINE hn::Vec<Floats> parabola(hn::Vec<Ints> winner, hn::Vec<Ints> before, hn::Vec<Ints> lowest, hn::Vec<Ints> after,
                                    size_t disparities) {
  const Ints ints;
  const Floats floats;
  const auto zero = hn::Zero(ints);
  const auto curvature = hn::Add(hn::Sub(before, hn::Add(lowest, lowest)), after);
  const auto border = hn::Or(hn::Eq(winner, zero), hn::Eq(winner, hn::Set(ints, static_cast<int32_t>(disparities) - 1)));
  const auto flat = hn::Or(border, hn::Eq(curvature, zero));
  const auto divisor = hn::IfThenElse(flat, hn::Set(ints, 1), hn::Add(curvature, curvature));
  const auto offset = hn::Div(hn::ConvertTo(floats, hn::Sub(after, before)), hn::ConvertTo(floats, divisor));
  return hn::Sub(hn::ConvertTo(floats, winner), hn::IfThenZeroElse(hn::RebindMask(floats, flat), offset));
}

/// disparity[0 .. width), -1 where not unique or where the right image disagrees; `right` is scratch of the row's padded width.
template <class T>
void finish_row(const WinnerRow<T>& row, size_t width, const MatchParameters& parameters, int32_t* right, float* disparity) {
  const Ints ints;
  const Floats floats;
  const size_t lanes = hn::Lanes(floats);
  const auto zero = hn::Zero(ints);
  const bool check = parameters.lr_max_diff >= 0;
  if (check) {
    for (size_t x = 0; x < width; x += lanes) hn::StoreU(load_ints(row.right_disparity + x), ints, right + x);
  }
  for (size_t x = 0; x < width; x += lanes) {
    const auto winner = load_ints(row.disparity + x);
    auto value = hn::ConvertTo(floats, winner);
    if (parameters.subpixel_parabola) {
      value = parabola(winner, load_ints(row.before + x), load_ints(row.lowest + x), load_ints(row.after + x), parameters.max_disparity);
    }
    auto invalid = hn::Ne(load_ints(row.ambiguous + x), zero);
    if (check) {
      const auto rounded = hn::ConvertTo(ints, hn::Add(value, hn::Set(floats, 0.5f)));
      const auto right_x = hn::Sub(hn::Iota(ints, static_cast<int32_t>(x)), rounded);
      const auto there = hn::GatherIndex(ints, right, hn::Max(right_x, zero));
      const auto differ = hn::Gt(hn::Abs(hn::Sub(rounded, there)), hn::Set(ints, parameters.lr_max_diff));
      invalid = hn::Or(invalid, hn::Or(hn::Lt(right_x, zero), differ));
    }
    hn::StoreU(hn::IfThenElse(hn::RebindMask(floats, invalid), hn::Set(floats, -1.0f), value), floats, disparity + x);
  }
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
