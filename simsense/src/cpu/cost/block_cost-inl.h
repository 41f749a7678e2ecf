// SPDX-License-Identifier: Apache-2.0
// Hamming cost summed over a block: across the columns for each row and disparity (row_sums-inl.h), then down the rows by adding the row
// that enters the block and taking off the one that leaves.
#if defined(SIMSENSE_CPU_BLOCK_COST_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_BLOCK_COST_INL_H_
#undef SIMSENSE_CPU_BLOCK_COST_INL_H_
#else
#define SIMSENSE_CPU_BLOCK_COST_INL_H_
#endif

#include <algorithm>

#include "cpu/cost/row_sums-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

/// Costs summed over a block, for a chunk of columns, row after row, downwards or upwards.
template <class T>
class BlockSweep {
 public:
  static constexpr size_t lanes = lane_count<T>, columns = 256, blocks = columns / lanes;

  BlockSweep(const CensusPlanes& left, const CensusPlanes& right, const MatchParameters& p, const Layout& layout)
      : layout_(layout),
        block_height_(p.block_height),
        row_sums_(left, right, p, layout, columns),
        history_(block_height_ * layout.disparities * columns * history_bytes()),
        sums_(blocks * pitch()) {}

  /// Starts a sweep: the next advance() gives row y, later ones y + direction and so on.
  void begin(size_t first_block, size_t y, int direction) {
    x_ = static_cast<ptrdiff_t>(first_block * lanes);
    direction_ = direction;
    slot_ = 0;
    std::fill_n(history_.data(), block_height_ * layout_.disparities * columns * history_bytes(), uint8_t{0});
    std::fill_n(sums_.data(), blocks * pitch(), T{0});
    y_ = static_cast<ptrdiff_t>(y) + direction * (static_cast<ptrdiff_t>(block_height_ / 2) - static_cast<ptrdiff_t>(block_height_ - 1));
    for (size_t k = 1; k < block_height_; ++k) advance(sums_.data(), pitch(), sums_.data(), pitch());
  }

  /// Moves the sums kept inside, [block][d][lanes], one row on.
  void advance(size_t) { advance(sums_.data(), pitch(), sums_.data(), pitch()); }
  HWY_INLINE StoredCosts<T> costs(size_t block) const { return {sums_.data() + block * pitch()}; }
  [[nodiscard]] const T* sums() const { return sums_.data(); }
  [[nodiscard]] size_t pitch() const { return layout_.disparities * lanes; }

  /// Computes the next row's sums from the previous row's. Pitches: elements from block to block.
  void advance(const T* previous, size_t previous_pitch, T* next, size_t next_pitch) {
    if (row_sums_.narrow()) {
      replace_row<uint8_t>(previous, previous_pitch, next, next_pitch);
    } else {
      replace_row<uint16_t>(previous, previous_pitch, next, next_pitch);
    }
    slot_ = slot_ + 1 == block_height_ ? 0 : slot_ + 1;
    y_ += direction_;
  }

 private:
  [[nodiscard]] size_t history_bytes() const { return row_sums_.narrow() ? 1 : 2; }

  template <class H>
  void replace_row(const T* previous, size_t previous_pitch, T* next, size_t next_pitch) {
    H* history = reinterpret_cast<H*>(history_.data()) + slot_ * layout_.disparities * columns;
    row_sums_.visit_row<H>(x_, y_, [&](size_t d, const H* entering) {
      H* leaving = history + d * columns;
      const Lanes<T> tag;
      const hn::Rebind<H, Lanes<T>> history_tag;
      for (size_t block = 0; block < blocks; ++block) {
        const auto fresh = hn::LoadU(history_tag, entering + block * lanes), old = hn::LoadU(history_tag, leaving + block * lanes);
        const auto less = hn::Sub(hn::Load(tag, previous + block * previous_pitch + d * lanes), widen<T>(old));
        hn::Store(hn::Add(less, widen<T>(fresh)), tag, next + block * next_pitch + d * lanes);
        hn::StoreU(fresh, history_tag, leaving + block * lanes);
      }
    });
  }

  const Layout& layout_;
  size_t block_height_;
  ptrdiff_t x_ = 0, y_ = 0;  // first column of the chunk; the row that enters next, possibly outside the image
  int direction_ = 1;
  size_t slot_ = 0;
  RowSums row_sums_;
  Buffer<uint8_t> history_;  // [block_height][d][columns] sums across of the rows inside the block, bytes or 16 bit
  Buffer<T> sums_;           // [block][d][lanes]
};

/// Costs summed over a block for a strip: all of it in column layout, the current tile in row layout.
template <class T>
class StoredStrip {
 public:
  StoredStrip(const CensusPlanes& left, const CensusPlanes& right, const MatchParameters& p, const Layout& layout)
      : layout_(layout),
        sweep_(left, right, p, layout),
        sums_(round_up(layout.blocks, Sweep::blocks) * block_pitch()),
        tile_(lanes * row_pitch()) {}

  void begin(Range rows) {
    rows_ = rows;
    for (size_t block = 0; block < layout_.blocks; block += Sweep::blocks) {
      sweep_.begin(block, rows.begin, 1);
      const T* previous = sweep_.sums();
      size_t previous_pitch = sweep_.pitch();
      for (size_t y = 0; y < rows.size(); ++y) {
        T* next = sums_.data() + block * block_pitch() + y * row_pitch();
        sweep_.advance(previous, previous_pitch, next, block_pitch());
        previous = next;
        previous_pitch = block_pitch();
      }
    }
  }
  void begin_tile(size_t block) {
    const T* from = sums_.data() + block * block_pitch();
    for (size_t d = 0; d < layout_.disparities; ++d) {
      transpose(from + d * lanes, row_pitch(), tile_.data() + d * lanes, row_pitch(), lanes);
    }
  }
  HWY_INLINE StoredCosts<T> column_costs(size_t block, size_t y) const {
    return {sums_.data() + block * block_pitch() + (y - rows_.begin) * row_pitch()};
  }
  HWY_INLINE StoredCosts<T> row_costs(size_t x) const { return {tile_.data() + x % lanes * row_pitch()}; }

 private:
  using Sweep = BlockSweep<T>;
  static constexpr size_t lanes = lane_count<T>;
  // one vector more than needed, so that the vectors of one disparity do not share cache sets
  [[nodiscard]] size_t row_pitch() const { return (layout_.disparities + 1) * lanes; }
  [[nodiscard]] size_t block_pitch() const { return lanes * row_pitch(); }

  const Layout& layout_;
  Range rows_{};
  Sweep sweep_;
  Buffer<T> sums_;  // [block][row][d][lanes]
  Buffer<T> tile_;  // [column][d][lanes]
};

/// Gives block sums as costs to the engines whose lanes are wider than a byte.
template <class T>
struct BlockCost {
  using Lane = T;
  static constexpr bool in_memory = true;
  using Sweep = BlockSweep<T>;

  /// The costs of a strip, tile by tile. Only the sums across are kept for the whole strip, in bytes if they fit; each tile sums them down
  /// the rows.
  class Strip {
   public:
    Strip(const CensusPlanes& left, const CensusPlanes& right, const MatchParameters& p, const Layout& layout)
        : layout_(layout),
          block_height_(p.block_height),
          row_sums_(left, right, p, layout, chunk_columns),
          across_(round_up(layout.blocks, chunk_blocks) * across_pitch() * (row_sums_.narrow() ? 1 : 2)),
          square_(lanes * lanes),
          columns_(lanes * row_pitch()),
          rows_tile_(lanes * row_pitch()) {}

    void begin(Range rows) {
      rows_ = rows;
      if (row_sums_.narrow()) {
        sum_across<uint8_t>();
      } else {
        sum_across<uint16_t>();
      }
    }
    /// Prepares row layout alone, for the leftward paths whose state alone is kept.
    void begin_pass(size_t block) { sum_tile(block, false); }
    void begin_tile(size_t block) { sum_tile(block, true); }
    HWY_INLINE StoredCosts<T> column_costs(size_t, size_t y) const { return {columns_.data() + (y - rows_.begin) * row_pitch()}; }
    HWY_INLINE StoredCosts<T> row_costs(size_t x) const { return {rows_tile_.data() + x % lanes * row_pitch()}; }

   private:
    static constexpr size_t lanes = lane_count<T>, chunk_columns = 256, chunk_blocks = chunk_columns / lanes;
    // one vector more than needed, so that the vectors of one disparity do not share cache sets
    [[nodiscard]] size_t row_pitch() const { return (layout_.disparities + 1) * lanes; }
    [[nodiscard]] size_t across_pitch() const { return (layout_.max_strip_rows() + block_height_ - 1) * row_pitch(); }

    template <class H>
    void sum_across() {
      const auto half = static_cast<ptrdiff_t>(block_height_ / 2);
      const hn::Rebind<H, Lanes<T>> tag;
      for (size_t chunk = 0; chunk < layout_.blocks; chunk += chunk_blocks) {
        for (size_t k = 0; k < rows_.size() + block_height_ - 1; ++k) {
          H* row = reinterpret_cast<H*>(across_.data()) + chunk * across_pitch() + k * row_pitch();
          const auto y = static_cast<ptrdiff_t>(rows_.begin + k) - half;
          row_sums_.visit_row<H>(static_cast<ptrdiff_t>(chunk * lanes), y, [&](size_t d, const H* sums) {
            for (size_t block = 0; block < chunk_blocks; ++block)
              hn::StoreU(hn::LoadU(tag, sums + block * lanes), tag, row + block * across_pitch() + d * lanes);
          });
        }
      }
    }

    void sum_tile(size_t block, bool keep_columns) {
      if (row_sums_.narrow()) {
        sum_down<uint8_t>(block, keep_columns);
      } else {
        sum_down<uint16_t>(block, keep_columns);
      }
    }

    template <class H>
    void sum_down(size_t block, bool keep_columns) {
      const Lanes<T> tag;
      const hn::Rebind<H, Lanes<T>> across_tag;
      const H* across = reinterpret_cast<const H*>(across_.data()) + block * across_pitch();
      constexpr size_t ahead = 256 / sizeof(H);  // rows lie apart: what comes next is asked for in time
      const size_t pitch = row_pitch(), to_pitch = keep_columns ? pitch : lanes;
      for (size_t d = 0; d < layout_.disparities; ++d) {
        const H* entering = across + d * lanes;
        T* first = keep_columns ? columns_.data() + d * lanes : square_.data();
        auto sum = hn::Zero(tag);
        for (size_t k = 0; k + 1 < block_height_; ++k, entering += pitch) {
          __builtin_prefetch(entering + ahead);
          sum = hn::Add(sum, widen<T>(hn::LoadU(across_tag, entering)));
        }
        const H* leaving = across + d * lanes;
        T* to = first;
        for (size_t y = 0; y < rows_.size(); ++y, entering += pitch, leaving += pitch, to += to_pitch) {
          __builtin_prefetch(entering + ahead);
          sum = hn::Add(sum, widen<T>(hn::LoadU(across_tag, entering)));
          hn::Store(sum, tag, to);
          sum = hn::Sub(sum, widen<T>(hn::LoadU(across_tag, leaving)));
        }
        transpose(first, to_pitch, rows_tile_.data() + d * lanes, pitch, lanes);
      }
    }

    const Layout& layout_;
    size_t block_height_;
    Range rows_{};
    RowSums row_sums_;
    Buffer<uint8_t> across_;  // [block][row of the strip and around it][d][lanes], bytes or 16 bit
    Buffer<T> square_;        // of one disparity
    Buffer<T> columns_;       // block sums of the tile: [row][d][lanes]
    Buffer<T> rows_tile_;     // [column][d][lanes]
  };
};

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
