// SPDX-License-Identifier: Apache-2.0
// Hamming cost of census words, computed where it is used: cheaper than storing a volume. Lanes are bytes.
#if defined(SIMSENSE_CPU_HAMMING_COST_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_HAMMING_COST_INL_H_
#undef SIMSENSE_CPU_HAMMING_COST_INL_H_
#else
#define SIMSENSE_CPU_HAMMING_COST_INL_H_
#endif

#include <algorithm>

#include "cpu/census/census.h"
#include "cpu/sgm/layout.h"
#include "cpu/sgm/path_step-inl.h"
#include "cpu/simd/transpose-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

/// Counts the set bits of a pixel's planes. Without a byte popcount instruction, three planes are first added to two (sum and carry).
template <size_t planes, class V>
HWY_INLINE V bit_count(const V* word) {
#if HWY_TARGET == HWY_AVX3_DL || HWY_ARCH_ARM
  const auto first_three = hn::Add(hn::Add(hn::PopulationCount(word[0]), hn::PopulationCount(word[1])), hn::PopulationCount(word[2]));
#else
  const auto differ = hn::Xor(word[0], word[1]);
  const auto sum = hn::Xor(differ, word[2]);
  const auto carry = hn::Or(hn::And(word[0], word[1]), hn::And(differ, word[2]));
  const auto carries = hn::PopulationCount(carry);
  const auto first_three = hn::Add(hn::PopulationCount(sum), hn::Add(carries, carries));
#endif
  if constexpr (planes == 3) return first_three;
  auto count = first_three;
  for (size_t p = 3; p < planes; ++p) count = hn::Add(count, hn::PopulationCount(word[p]));
  return count;
}

/// Costs of neighbouring columns, one per lane: a disparity moves the right image's bytes by one.
template <size_t planes>
struct ColumnCosts {
  Vector<uint8_t> left[planes];
  const uint8_t* right[planes];
  HWY_INLINE ColumnCosts(const CensusPlanes& left_census, const CensusPlanes& right_census, ptrdiff_t x, size_t y) {
    for (size_t p = 0; p < planes; ++p) {
      left[p] = hn::LoadU(Lanes<uint8_t>(), left_census.row(p, y) + x);
      right[p] = right_census.row(p, y) + x;
    }
  }
  HWY_INLINE Vector<uint8_t> operator()(size_t d) const {
    Vector<uint8_t> word[planes];
    for (size_t p = 0; p < planes; ++p) word[p] = hn::Xor(left[p], hn::LoadU(Lanes<uint8_t>(), right[p] - static_cast<ptrdiff_t>(d)));
    return bit_count<planes>(word);
  }
};

/// Costs of neighbouring rows, one per lane: a disparity moves by whole vectors of a transposed strip, [x][plane][lanes].
template <size_t planes>
struct RowCosts {
  Vector<uint8_t> left[planes];
  const uint8_t* right;
  HWY_INLINE RowCosts(const uint8_t* left_strip, const uint8_t* right_strip) : right(right_strip) {
    for (size_t p = 0; p < planes; ++p) left[p] = hn::Load(Lanes<uint8_t>(), left_strip + p * lane_count<uint8_t>);
  }
  HWY_INLINE Vector<uint8_t> operator()(size_t d) const {
    constexpr size_t lanes = lane_count<uint8_t>;
    const uint8_t* at_d = right - static_cast<ptrdiff_t>(d * planes * lanes);
    Vector<uint8_t> word[planes];
    for (size_t p = 0; p < planes; ++p) word[p] = hn::Xor(left[p], hn::Load(Lanes<uint8_t>(), at_d + p * lanes));
    return bit_count<planes>(word);
  }
};

/// Gives Hamming distances as costs to the engine with byte lanes; block_cost-inl.h serves the others. sgm-inl.h uses either.
template <size_t planes>
struct HammingCost {
  using Lane = uint8_t;
  static constexpr bool in_memory = false;  // asking twice means computing twice

  /// The costs of one block of columns, row after row.
  class Sweep {
   public:
    static constexpr size_t blocks = 1;
    Sweep(const CensusPlanes& left, const CensusPlanes& right, const MatchParameters&, const Layout&) : left_(left), right_(right) {}
    void begin(size_t first_block, size_t, int) { x_ = static_cast<ptrdiff_t>(first_block * lane_count<uint8_t>); }
    void advance(size_t y) { y_ = y; }
    HWY_INLINE ColumnCosts<planes> costs(size_t) const { return ColumnCosts<planes>(left_, right_, x_, y_); }

   private:
    const CensusPlanes& left_;
    const CensusPlanes& right_;
    ptrdiff_t x_ = 0;
    size_t y_ = 0;
  };

  /// The costs of a strip of rows, in row and column layout.
  class Strip {
   public:
    Strip(const CensusPlanes& left, const CensusPlanes& right, const MatchParameters&, const Layout& layout)
        : left_(left),
          right_(right),
          layout_(layout),
          left_strip_(layout.blocks * lanes * pixel),
          right_strip_((layout.blocks * lanes + left_columns()) * pixel) {}

    void begin(Range rows) {
      uint8_t* right_column0 = right_strip_.data() + left_columns() * pixel;
      const ptrdiff_t first = right_.shift() < 0 ? -static_cast<ptrdiff_t>(left_columns()) : 0;
      const ptrdiff_t end = static_cast<ptrdiff_t>(layout_.blocks * lanes);
      for (size_t p = 0; p < planes; ++p) {
        for (ptrdiff_t x = 0; x < end; x += lanes) transpose_columns(left_, p, rows, x, left_strip_.data());
        for (ptrdiff_t x = first; x < end; x += lanes) transpose_columns(right_, p, rows, x, right_column0);
      }
      if (first == 0) {
        for (size_t d = 1; d <= layout_.disparities; ++d) std::copy_n(right_column0, pixel, right_column0 - d * pixel);
      }
    }
    void begin_pass(size_t) {}
    void begin_tile(size_t) {}
    HWY_INLINE ColumnCosts<planes> column_costs(size_t block, size_t y) const {
      return ColumnCosts<planes>(left_, right_, static_cast<ptrdiff_t>(block * lanes), y);
    }
    HWY_INLINE RowCosts<planes> row_costs(size_t x) const {
      return RowCosts<planes>(left_strip_.data() + x * pixel, right_strip_.data() + (left_columns() + x) * pixel);
    }

   private:
    static constexpr size_t lanes = lane_count<uint8_t>, pixel = planes * lanes;
    [[nodiscard]] size_t left_columns() const { return round_up(layout_.disparities, lanes); }

    /// Transposes a square of columns from x on into the strip that begins at column0.
    static void transpose_columns(const CensusPlanes& census, size_t plane, Range rows, ptrdiff_t x, uint8_t* column0) {
      const Lanes<uint8_t> tag;
      HWY_ALIGN uint8_t square[lanes * lanes];
      for (size_t i = 0; i < lanes; ++i) {
        const size_t y = std::min(rows.begin + i, rows.end - 1);
        hn::Store(hn::LoadU(tag, census.row(plane, y) + x), tag, square + i * lanes);
      }
      transpose(square, lanes, column0 + x * static_cast<ptrdiff_t>(pixel) + static_cast<ptrdiff_t>(plane * lanes), pixel, lanes);
    }

    const CensusPlanes& left_;
    const CensusPlanes& right_;
    const Layout& layout_;
    Buffer<uint8_t> left_strip_, right_strip_;
  };
};

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
