// SPDX-License-Identifier: Apache-2.0
// Hamming costs of a row summed over the block's width, for a chunk of columns and all disparities.
#if defined(SIMSENSE_CPU_ROW_SUMS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_ROW_SUMS_INL_H_
#undef SIMSENSE_CPU_ROW_SUMS_INL_H_
#else
#define SIMSENSE_CPU_ROW_SUMS_INL_H_
#endif

#include <algorithm>

#include "cpu/cost/hamming_cost-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

template <class To, class V>
HWY_INLINE Vector<To> widen(V narrow) {
  if constexpr (sizeof(To) == sizeof(hn::TFromV<V>)) {
    return narrow;
  } else {
    return hn::PromoteTo(Lanes<To>(), narrow);
  }
}

class RowSums {
 public:
  /// columns: of a chunk; a multiple of 64.
  RowSums(const CensusPlanes& left, const CensusPlanes& right, const MatchParameters& p, const Layout& layout, size_t columns)
      : left_(left),
        right_(right),
        layout_(layout),
        columns_(columns),
        block_width_(p.block_width),
        narrow_(p.block_width * p.census_bits() <= 255),
        hamming_pitch_(round_up(columns + p.block_width - 1, 64) + 64),
        hamming_(batch * hamming_pitch_),
        sums_(columns) {}

  /// Whether a row's sum fits a byte.
  [[nodiscard]] bool narrow() const { return narrow_; }

  /// Calls visit(d, sums) for each disparity. sums: of the chunk's columns from x on, as H (uint8_t if narrow(), else uint16_t). Beyond the
  /// image the nearest pixel's cost counts.
  template <class H, class Visit>
  HWY_INLINE void visit_row(ptrdiff_t x, ptrdiff_t y, Visit&& visit) {
    const auto row = static_cast<size_t>(std::clamp<ptrdiff_t>(y, 0, static_cast<ptrdiff_t>(layout_.height) - 1));
    for (size_t d = 0; d < layout_.disparities; d += batch) {
      const size_t count = std::min(batch, layout_.disparities - d);
      switch (left_.plane_count()) {
        case 3:
          hamming<3>(x, row, d, count);
          break;
        case 4:
          hamming<4>(x, row, d, count);
          break;
        case 6:
          hamming<6>(x, row, d, count);
          break;
        default:
          hamming<8>(x, row, d, count);
      }
      for (size_t k = 0; k < count; ++k) {
        H* sums = reinterpret_cast<H*>(sums_.data());
        sum_across<H>(hamming_.data() + k * hamming_pitch_, sums);
        visit(d + k, sums);
      }
    }
  }

 private:
  static constexpr size_t batch = 16;  // disparities at once: the left image's bytes stay in registers

  /// Computes the costs of `count` disparities from d on, in one row, from column x - block_width / 2 on.
  template <size_t planes>
  void hamming(ptrdiff_t x, size_t row, size_t d, size_t count) {
    const ptrdiff_t first = x - static_cast<ptrdiff_t>(block_width_ / 2);
    const size_t length = columns_ + block_width_ - 1;
    for (size_t i = 0; i < length; i += lane_count<uint8_t>) {
      const ColumnCosts<planes> costs(left_, right_, first + static_cast<ptrdiff_t>(i), row);
      for (size_t k = 0; k < count; ++k) hn::StoreU(costs(d + k), Lanes<uint8_t>(), hamming_.data() + k * hamming_pitch_ + i);
    }
    const size_t before = first < 0 ? static_cast<size_t>(-first) : 0;
    const size_t inside = static_cast<size_t>(static_cast<ptrdiff_t>(layout_.width) - first);
    if (before == 0 && inside >= length) return;
    for (size_t k = 0; k < count; ++k) {
      uint8_t* costs = hamming_.data() + k * hamming_pitch_;
      std::fill_n(costs, before, costs[before]);
      if (inside < length) std::fill(costs + inside, costs + length, costs[inside - 1]);
    }
  }

  /// Sums block_width_ neighbouring costs. Every partial sum fits H.
  template <class H>
  HWY_INLINE void sum_across(const uint8_t* costs, H* sums) const {
    const Lanes<H> tag;
    for (size_t i = 0; i < columns_; i += lane_count<H>) {
      const hn::Rebind<uint8_t, Lanes<H>> cost_tag;
      auto sum = widen<H>(hn::LoadU(cost_tag, costs + i));
      for (size_t k = 1; k < block_width_; ++k) sum = hn::Add(sum, widen<H>(hn::LoadU(cost_tag, costs + i + k)));
      hn::Store(sum, tag, sums + i);
    }
  }

  const CensusPlanes& left_;
  const CensusPlanes& right_;
  const Layout& layout_;
  size_t columns_, block_width_;
  bool narrow_;
  size_t hamming_pitch_;     // a chunk and the block's width, in whole vectors
  Buffer<uint8_t> hamming_;  // [batch][hamming_pitch_]
  Buffer<uint16_t> sums_;    // of one disparity
};

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
