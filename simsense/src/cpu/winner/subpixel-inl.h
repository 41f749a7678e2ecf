// SPDX-License-Identifier: Apache-2.0
// From a row's winners to disparities: uniqueness, subpixel step, left-right check. Lanes are pixels, float.
#if defined(SIMSENSE_CPU_SUBPIXEL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_SUBPIXEL_INL_H_
#undef SIMSENSE_CPU_SUBPIXEL_INL_H_
#else
#define SIMSENSE_CPU_SUBPIXEL_INL_H_
#endif

#include "cpu/simd/buffer.h"
#include "cpu/winner/winner-inl.h"
#include "match/matcher.h"

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

/// Whether the equiangular step reads the block's costs: only if there is a block.
inline bool uses_block_costs(const MatchParameters& p) { return p.subpixel == Subpixel::equiangular && p.block_area() > 1; }

struct Triple {
  hn::Vec<Ints> before, lowest, after;
};

/// Costs of the winner and its neighbours: the block's if they have a minimum there, else the aggregated ones.
template <class T>
HWY_INLINE Triple costs_at(const WinnerRow<T>& row, size_t x, bool block_costs) {
  const Triple summed{load_ints(row.before + x), load_ints(row.lowest + x), load_ints(row.after + x)};
  if (!block_costs) return summed;
  const Triple block{load_ints(row.block_before + x), load_ints(row.block_lowest + x), load_ints(row.block_after + x)};
  const auto minimum = hn::Eq(hn::Min(block.lowest, hn::Min(block.before, block.after)), block.lowest);
  return {hn::IfThenElse(minimum, block.before, summed.before), hn::IfThenElse(minimum, block.lowest, summed.lowest),
          hn::IfThenElse(minimum, block.after, summed.after)};
}

/// Returns the winner plus the vertex of the parabola, or the apex of the V, through the three costs. At the first or last disparity, or
/// for equal costs, returns the winner.
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

/// The rows of the maps that finish_row() writes; nullptr for maps that are not wanted. One vector beyond the width is readable and
/// writable.
struct MapRows {
  float *disparity, *confidence;
  uint8_t* reason;  // MatchReason
};

/// 1 - lowest / second cost; 0 if the second is 0.
template <class T>
HWY_INLINE hn::Vec<Floats> confidence_of(const WinnerRow<T>& row, size_t x) {
  const Floats floats;
  const auto second = load_ints(row.second + x), none = hn::Zero(Ints());
  const auto divisor = hn::ConvertTo(floats, hn::Max(second, hn::Set(Ints(), 1)));
  const auto ratio = hn::Div(hn::ConvertTo(floats, load_ints(row.lowest + x)), divisor);
  return hn::IfThenZeroElse(hn::RebindMask(floats, hn::Eq(second, none)), hn::Sub(hn::Set(floats, 1.0f), ratio));
}

template <class V>
HWY_INLINE V reason_where(hn::Mask<hn::DFromV<V>> mask, MatchReason reason, V otherwise) {
  return hn::IfThenElse(mask, hn::Set(hn::DFromV<V>(), static_cast<int32_t>(reason)), otherwise);
}

/// Writes a row's disparities, and finds pixels that are not unique or disagree with the right image. `right`: scratch of
/// right_scratch_size().
template <class T>
void finish_row(const WinnerRow<T>& row, size_t width, const MatchParameters& parameters, int32_t* right, const MapRows& maps) {
  const Ints ints;
  const Floats floats;
  const size_t lanes = hn::Lanes(floats);
  const auto zero = hn::Zero(ints);
  const bool check = parameters.lr_max_diff >= 0;
  // Columns count from the one that sees min_disparity: a negative one lets right pixels lie left of 0.
  const ptrdiff_t before = parameters.min_disparity < 0 ? static_cast<ptrdiff_t>(round_up(parameters.max_disparity, lanes)) : 0;
  if (check) {
    for (ptrdiff_t x = -before; x < static_cast<ptrdiff_t>(width); x += static_cast<ptrdiff_t>(lanes))
      hn::StoreU(load_ints(row.right_disparity + x), ints, right + before + x);
  }
  const auto first_right = hn::Set(ints, parameters.min_disparity);
  const auto last_right = hn::Set(ints, parameters.min_disparity + static_cast<int32_t>(width) - 1);
  for (size_t x = 0; x < width; x += lanes) {
    const auto winner = load_ints(row.disparity + x);
    auto value = hn::ConvertTo(floats, winner);
    if (parameters.subpixel != Subpixel::none) {
      const Triple costs = costs_at(row, x, uses_block_costs(parameters));
      value = between(winner, costs, parameters.subpixel, parameters.max_disparity);
    }
    auto reason = zero;
    if (check) {
      const auto rounded = hn::ConvertTo(ints, hn::Add(value, hn::Set(floats, 0.5f)));
      const auto right_x = hn::Sub(hn::Iota(ints, static_cast<int32_t>(x)), rounded);
      const auto at = hn::Add(right_x, hn::Set(ints, static_cast<int32_t>(before)));
      const auto there = hn::GatherIndex(ints, right, hn::Max(at, zero));
      const auto differ = hn::Gt(hn::Abs(hn::Sub(rounded, there)), hn::Set(ints, parameters.lr_max_diff));
      const auto outside = hn::Or(hn::Lt(right_x, first_right), hn::Gt(right_x, last_right));
      reason = reason_where(outside, MatchReason::outside, reason_where(differ, MatchReason::occluded, zero));
    }
    reason = reason_where(hn::Ne(load_ints(row.ambiguous + x), zero), MatchReason::not_unique, reason);
    const auto invalid = hn::RebindMask(floats, hn::Ne(reason, zero));
    const auto shifted = hn::Add(value, hn::Set(floats, static_cast<float>(parameters.min_disparity)));
    hn::StoreU(hn::IfThenElse(invalid, hn::Set(floats, parameters.invalid_disparity()), shifted), floats, maps.disparity + x);
    if (maps.confidence) hn::StoreU(confidence_of(row, x), floats, maps.confidence + x);
    if (maps.reason) {
      const hn::Rebind<uint8_t, Floats> bytes;
      hn::StoreU(hn::DemoteTo(bytes, reason), bytes, maps.reason + x);
    }
  }
}

/// Elements of finish_row()'s scratch.
inline size_t right_scratch_size(size_t width, size_t disparities) { return round_up(disparities, 16) + width + 64; }

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
