// SPDX-License-Identifier: Apache-2.0
// The winners of a strip of rows: each pixel's result after its costs are summed, kept until whole rows become maps.
#if defined(SIMSENSE_CPU_WINNER_STRIP_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_WINNER_STRIP_INL_H_
#undef SIMSENSE_CPU_WINNER_STRIP_INL_H_
#else
#define SIMSENSE_CPU_WINNER_STRIP_INL_H_
#endif

#include <algorithm>
#include <vector>

#include "cpu/sgm/layout.h"
#include "cpu/sgm/path_step-inl.h"
#include "cpu/winner/subpixel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

/// Inputs that all workers share.
template <class T>
struct Shared {
  Layout layout;
  MatchParameters parameters;
  Penalties<T> penalties;
  std::vector<T> thresholds;

  Shared(const Layout& l, const MatchParameters& p, const PenaltyMaps& maps)
      : layout(l),
        parameters(p),
        penalties{static_cast<T>(p.p1 * p.block_area()), static_cast<T>(p.p2 * p.block_area()), static_cast<T>(p.block_area()), &maps},
        thresholds(uniqueness_thresholds<T>(p.uniqueness_ratio, (p.census_bits() + p.p2) * p.block_area())) {}
};

template <class T>
class WinnerStrip {
  static constexpr size_t lanes = lane_count<T>;

 public:
  explicit WinnerStrip(const Shared<T>& shared)
      : shared_(shared),
        layout_(shared.layout),
        row_pitch_(layout_.blocks * lanes),
        right_pitch_(round_up(layout_.disparities + lanes, lanes) + row_pitch_),
        summed_(layout_.disparities),
        winners_(planes * layout_.max_strip_rows() * row_pitch_),
        right_(2 * layout_.max_strip_rows() * right_pitch_),
        right_row_(right_scratch_size(row_pitch_, layout_.disparities)),
        disparity_row_(row_pitch_ + 64),
        confidence_row_(row_pitch_ + 64),
        reason_row_(row_pitch_ + 64) {}

  void begin(Range rows, bool with_confidence) {
    rows_ = rows;
    with_confidence_ = with_confidence;
    const size_t right_size = layout_.max_strip_rows() * right_pitch_;
    std::fill_n(right_.data(), right_size, hwy::LimitsMax<T>());
    std::fill_n(right_.data() + right_size, right_size, T{0});
  }

  /// Takes the last path's step at one vector of pixels, and finds mean and winner of all paths meanwhile.
  template <class MeanPath, class State>
  HWY_INLINE void sum_and_win(const MeanPath& mean, const StoredCosts<T>& cost, State state, PathDirection direction, size_t block,
                              size_t y) {
    const Lanes<T> tag;
    const size_t x = block * lanes;
    SumAndWinner<T, MeanPath> winner(mean, summed_.row(0));
    const auto p2 = shared_.penalties.columns(direction, static_cast<ptrdiff_t>(x), y);
    path_step(shared_.penalties.p1, p2, layout_.disparities, cost, state, winner);
    winner.finish();
    const WinnerRow<T> row = winner_row(y);
    hn::Store(winner.winner, tag, row.disparity + x);
    hn::Store(winner.before, tag, row.before + x);
    hn::Store(winner.lowest, tag, row.lowest + x);
    hn::Store(winner.after, tag, row.after + x);
    hn::Store(ambiguity(winner, layout_.disparities, summed_.row(0), shared_.thresholds), tag, row.ambiguous + x);
    if (with_confidence_) hn::Store(second_lowest(winner.winner, layout_.disparities, summed_.row(0)), tag, row.second + x);
    if (uses_block_costs(shared_.parameters)) {
      costs_around(row.disparity + x, cost.row, layout_.disparities, row.block_before + x, row.block_lowest + x, row.block_after + x);
    }
    if (shared_.parameters.lr_max_diff >= 0) offer(block, row);
  }

  /// Writes the strip's rows of the maps after all blocks.
  void finish(const MatchMaps& maps) {
    const size_t width = layout_.width;
    const MapRows rows{disparity_row_.data(), maps.confidence ? confidence_row_.data() : nullptr,
                       maps.reason ? reason_row_.data() : nullptr};
    for (size_t y = rows_.begin; y < rows_.end; ++y) {
      finish_row(winner_row(y), width, shared_.parameters, right_row_.data(), rows);
      std::copy_n(rows.disparity, width, maps.disparity + y * width);
      if (maps.confidence) std::copy_n(rows.confidence, width, maps.confidence + y * width);
      if (maps.reason) std::copy_n(rows.reason, width, reinterpret_cast<uint8_t*>(maps.reason) + y * width);
    }
  }

 private:
  static constexpr size_t planes = 9;

  HWY_INLINE void offer(size_t block, const WinnerRow<T>& row) {
    const size_t inside = layout_.columns(block).size();
    if (inside < lanes) {  // no right pixel may match what lies beyond the last column
      for (size_t d = 0; d < layout_.disparities; ++d) std::fill(summed_.row(d) + inside, summed_.row(d) + lanes, hwy::LimitsMax<T>());
    }
    offer_to_right(layout_.disparities, summed_.row(0), row.right_lowest + block * lanes, row.right_disparity + block * lanes);
  }

  WinnerRow<T> winner_row(size_t y) {
    const size_t plane = layout_.max_strip_rows() * row_pitch_, right_plane = layout_.max_strip_rows() * right_pitch_;
    T* row = winners_.data() + (y - rows_.begin) * row_pitch_;
    T* right = right_.data() + (y - rows_.begin) * right_pitch_ + right_pitch_ - row_pitch_;
    return {row,
            row + plane,
            row + 2 * plane,
            row + 3 * plane,
            row + 4 * plane,
            row + 5 * plane,
            row + 6 * plane,
            row + 7 * plane,
            row + 8 * plane,
            right,
            right + right_plane};
  }

  const Shared<T>& shared_;
  const Layout& layout_;
  size_t row_pitch_, right_pitch_;
  Range rows_{};
  bool with_confidence_ = false;
  SummedCosts<T> summed_;
  Buffer<T> winners_, right_;
  Buffer<int32_t> right_row_;
  Buffer<float> disparity_row_, confidence_row_;
  Buffer<uint8_t> reason_row_;
};

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
