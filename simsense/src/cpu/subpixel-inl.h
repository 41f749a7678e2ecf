// From a row's winners to disparities: uniqueness, subpixel step, left-right check. Lanes are pixels, float.
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

/// The equiangular step looks at the block's costs, where there is a block.
inline bool uses_block_costs(const MatchParameters& p) { return p.subpixel == Subpixel::equiangular && p.block_width * p.block_height > 1; }

struct Triple {
  hn::Vec<Ints> before, lowest, after;
};

/// The winner's costs and its neighbours': the block's where they have a minimum there, else the aggregated ones.
template <class T>
HWY_INLINE Triple costs_at(const WinnerRow<T>& row, size_t x, bool block_costs) {
  const Triple summed{load_ints(row.before + x), load_ints(row.lowest + x), load_ints(row.after + x)};
  if (!block_costs) return summed;
  const Triple block{load_ints(row.block_before + x), load_ints(row.block_lowest + x), load_ints(row.block_after + x)};
  const auto minimum = hn::Eq(hn::Min(block.lowest, hn::Min(block.before, block.after)), block.lowest);
  return {hn::IfThenElse(minimum, block.before, summed.before), hn::IfThenElse(minimum, block.lowest, summed.lowest),
          hn::IfThenElse(minimum, block.after, summed.after)};
}

/// Winner plus the vertex of the parabola, or the apex of the V, through the three; the winner itself at d = 0, at the last d and where
/// they are equal.
HWY_INLINE hn::Vec<Floats> between(hn::Vec<Ints> winner, const Triple& cost, Subpixel subpixel, size_t disparities) {
  const Ints ints;
  const Floats floats;
  const auto zero = hn::Zero(ints);
  const auto rise = subpixel == Subpixel::parabola ? hn::Sub(hn::Add(cost.before, cost.after), hn::Add(cost.lowest, cost.lowest))
                                                   : hn::Sub(hn::Max(cost.before, cost.after), cost.lowest);
  const auto border = hn::Or(hn::Eq(winner, zero), hn::Eq(winner, hn::Set(ints, static_cast<int32_t>(disparities) - 1)));
  const auto flat = hn::Or(border, hn::Eq(rise, zero));
  const auto divisor = hn::IfThenElse(flat, hn::Set(ints, 1), hn::Add(rise, rise));
  const auto offset = hn::Div(hn::ConvertTo(floats, hn::Sub(cost.after, cost.before)), hn::ConvertTo(floats, divisor));
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
    if (parameters.subpixel != Subpixel::none) {
      const Triple costs = costs_at(row, x, uses_block_costs(parameters));
      value = between(winner, costs, parameters.subpixel, parameters.max_disparity);
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
