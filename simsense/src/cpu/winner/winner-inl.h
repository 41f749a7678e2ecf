// SPDX-License-Identifier: Apache-2.0
// Winner over the disparities for a vector of pixels, while the sums come in: lowest cost, its neighbours, uniqueness, and each right
// pixel's winner.
#if defined(SIMSENSE_CPU_WINNER_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_WINNER_INL_H_
#undef SIMSENSE_CPU_WINNER_INL_H_
#else
#define SIMSENSE_CPU_WINNER_INL_H_
#endif

#include <algorithm>
#include <vector>

#include "cpu/simd/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

/// Each pixel of a row after the winner stage.
template <class T>
struct WinnerRow {
  T *disparity, *before, *lowest, *after;        // winner and the costs at winner - 1, winner, winner + 1
  T* ambiguous;                                  // nonzero: not unique
  T *block_before, *block_lowest, *block_after;  // the block's own costs there, for the equiangular step
  T* second;                                     // lowest cost of a disparity that is no neighbour of the winner, for the confidence
  T *right_lowest, *right_disparity;             // per right pixel; may be written up to max_disparity columns left of the image
};

/// The summed costs of one vector of pixels, [d][lanes of data, lanes of `unreachable`]. A load that is shifted by k lanes reads
/// `unreachable`, never a neighbour's cost.
template <class T>
class SummedCosts {
 public:
  explicit SummedCosts(size_t disparities) : storage_((disparities + 2) * 2 * lanes) {
    std::fill_n(storage_.data(), (disparities + 2) * 2 * lanes, hwy::LimitsMax<T>());
  }
  T* row(size_t d) { return storage_.data() + (2 * d + 2) * lanes; }

 private:
  static constexpr size_t lanes = lane_count<T>;
  Buffer<T> storage_;
};

/// Mean m over four paths. `across` holds the sum of two, `up` the path opposite to the last.
template <class T>
struct MeanOfFour {
  const T* HWY_RESTRICT across;
  const T* HWY_RESTRICT up;
  HWY_INLINE Vector<T> operator()(size_t d, Vector<T> m) const {
    const Lanes<T> tag;
    return quarter_sum(hn::Load(tag, across + d * lane_count<T>), hn::Add(m, hn::Load(tag, up + d * lane_count<T>)));
  }
};

/// Mean m over eight paths. `others` holds the sum of seven.
template <class T>
struct MeanOfEight {
  const T* HWY_RESTRICT others;
  HWY_INLINE Vector<T> operator()(size_t d, Vector<T> m) const {
    return hn::ShiftRight<3>(hn::Add(m, hn::Load(Lanes<T>(), others + d * lane_count<T>)));
  }
};

/// Visitor of the last path: sums all paths and keeps the lowest sum.
template <class T, class MeanPath>
struct SumAndWinner {
  using V = Vector<T>;
  MeanPath mean;
  T* HWY_RESTRICT summed;
  V lowest, winner, index, before, after, last;
  hn::Mask<Lanes<T>> last_stayed;

  HWY_INLINE SumAndWinner(const MeanPath& mean_path, T* summed_row) : mean(mean_path), summed(summed_row) {
    const Lanes<T> tag;
    lowest = before = after = last = hn::Set(tag, hwy::LimitsMax<T>());
    winner = index = hn::Zero(tag);
    last_stayed = hn::Eq(index, index);
  }
  HWY_INLINE void operator()(size_t d, V m, V cost) {
    const Lanes<T> tag;
    constexpr size_t lanes = lane_count<T>;
    const V sum = hn::Add(mean(d, m), cost);
    hn::Store(sum, tag, summed + d * 2 * lanes);
    const V lower = hn::Min(lowest, sum);
    const auto stays = hn::Eq(lower, lowest);  // on a tie the smaller disparity stays
    after = hn::IfThenElse(last_stayed, after, sum);
    before = hn::IfThenElse(stays, before, last);
    winner = hn::IfThenElse(stays, winner, index);
    lowest = lower;
    last = sum;
    last_stayed = stays;
    index = hn::Add(index, hn::Set(tag, 1));
  }
  /// Sets the cost after a winner at the last disparity: there is none.
  HWY_INLINE void finish() { after = hn::IfThenElse(last_stayed, after, hn::Set(Lanes<T>(), hwy::LimitsMax<T>())); }
};

/// Reads each lane's costs at its winner and beside it. At an end of the range, the winner's own cost replaces the missing one.
template <class T>
HWY_INLINE void costs_around(const T* winner, const T* costs, size_t disparities, T* before, T* at, T* after) {
  constexpr size_t lanes = lane_count<T>;
  for (size_t lane = 0; lane < lanes; ++lane) {
    const size_t d = winner[lane];
    at[lane] = costs[d * lanes + lane];
    before[lane] = costs[(d - (d > 0)) * lanes + lane];
    after[lane] = costs[(d + (d + 1 < disparities)) * lanes + lane];
  }
}

/// For each cost c of a winner, the lowest cost that another disparity may have: the smallest t with t * (100 - ratio) >= c * 100.
template <class T>
std::vector<T> uniqueness_thresholds(uint32_t ratio, size_t max_cost) {
  std::vector<T> thresholds(max_cost + 1);
  for (size_t c = 0; c <= max_cost; ++c) {
    const size_t rest = 100 - ratio;
    const size_t threshold = rest > 0 ? (c * 100 + rest - 1) / rest : (c > 0 ? hwy::LimitsMax<T>() : 0);
    thresholds[c] = static_cast<T>(std::min<size_t>(threshold, hwy::LimitsMax<T>()));
  }
  return thresholds;
}

/// Nonzero if a disparity that is no neighbour of the winner costs less than its threshold: more disparities do than winner and neighbours.
template <class T, class MeanPath>
HWY_INLINE Vector<T> ambiguity(const SumAndWinner<T, MeanPath>& w, size_t disparities, const T* summed, const std::vector<T>& thresholds) {
  const Lanes<T> tag;
  constexpr size_t lanes = lane_count<T>;
  HWY_ALIGN T per_lane[lanes];
  hn::Store(hn::Min(w.lowest, hn::Set(tag, static_cast<T>(thresholds.size() - 1))), tag, per_lane);
  for (T& value : per_lane) value = thresholds[value];
  const auto threshold = hn::Load(tag, per_lane);
  auto count = hn::Zero(tag);  // counts downwards: a true mask is -1
#pragma GCC unroll 8
  for (size_t d = 0; d < disparities; ++d) {
    count = hn::Add(count, hn::VecFromMask(tag, hn::Lt(hn::Load(tag, summed + d * 2 * lanes), threshold)));
  }
  const auto own = hn::Add(hn::VecFromMask(tag, hn::Lt(w.lowest, threshold)),
                           hn::Add(hn::VecFromMask(tag, hn::Lt(w.before, threshold)), hn::VecFromMask(tag, hn::Lt(w.after, threshold))));
  return hn::Xor(count, own);
}

/// The lowest cost among disparities that are no neighbours of the winner.
template <class T>
HWY_INLINE Vector<T> second_lowest(Vector<T> winner, size_t disparities, const T* summed) {
  const Lanes<T> tag;
  const auto one = hn::Set(tag, 1);
  auto lowest = hn::Set(tag, hwy::LimitsMax<T>()), index = hn::Zero(tag);
  for (size_t d = 0; d < disparities; ++d) {
    const auto distance = hn::Sub(hn::Max(index, winner), hn::Min(index, winner));
    const auto sum = hn::Load(tag, summed + d * 2 * lane_count<T>);
    lowest = hn::IfThenElse(hn::Gt(distance, one), hn::Min(lowest, sum), lowest);
    index = hn::Add(index, one);
  }
  return lowest;
}

/// Offers each pixel's costs to their right pixels: column x at disparity d belongs to right column x - d. Blocks come from left to right,
/// so a right pixel meets its disparities in ascending order, and the smaller one wins a tie.
template <class T>
HWY_INLINE void offer_to_right(size_t disparities, const T* summed, T* HWY_RESTRICT right_lowest, T* HWY_RESTRICT right_disparity) {
  const Lanes<T> tag;
  constexpr ptrdiff_t lanes = static_cast<ptrdiff_t>(lane_count<T>);
  const ptrdiff_t last = static_cast<ptrdiff_t>(disparities) - 1;
  for (ptrdiff_t shift = 0; shift - lanes < last; shift += lanes) {
    auto lowest = hn::LoadU(tag, right_lowest - shift), winner = hn::LoadU(tag, right_disparity - shift);
    const ptrdiff_t first = std::max<ptrdiff_t>(0, shift - lanes + 1), end = std::min(last, shift + lanes - 1) + 1;
    auto index = hn::Set(tag, static_cast<T>(first));
#pragma GCC unroll 4
    for (ptrdiff_t d = first; d < end; ++d) {
      const auto sum = hn::LoadU(tag, summed + d * 2 * lanes + d - shift);
      const auto lower = hn::Min(lowest, sum);
      winner = hn::IfThenElse(hn::Eq(lower, lowest), winner, index);
      lowest = lower;
      index = hn::Add(index, hn::Set(tag, 1));
    }
    hn::StoreU(lowest, tag, right_lowest - shift);
    hn::StoreU(winner, tag, right_disparity - shift);
  }
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
