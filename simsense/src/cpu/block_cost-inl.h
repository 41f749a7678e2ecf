// Hamming cost summed over a block, by running sums: across the columns for each row and disparity, then down the rows by adding the row
// that enters the block and taking off the one that leaves. A strip of sums is kept in memory.
#if defined(SIMSENSE_CPU_BLOCK_COST_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_BLOCK_COST_INL_H_
#undef SIMSENSE_CPU_BLOCK_COST_INL_H_
#else
#define SIMSENSE_CPU_BLOCK_COST_INL_H_
#endif

#include <algorithm>

#include "cpu/hamming_cost-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

/// Block sums of a chunk of columns, row after row, downwards or upwards. Outside the image the nearest pixel's cost counts.
template <class T>
class BlockSweep {
 public:
  static constexpr size_t lanes = lane_count<T>, columns = 256, blocks = columns / lanes;

  BlockSweep(const CensusPlanes& left, const CensusPlanes& right, const MatchParameters& p, const Layout& layout)
      : left_(left),
        right_(right),
        layout_(layout),
        block_width_(p.block_width),
        block_height_(p.block_height),
        narrow_(p.block_width * p.census_bits() <= 255),
        hamming_(batch * hamming_pitch),
        fresh_(columns),
        history_(block_height_ * layout.disparities * columns * (narrow_ ? 1 : 2)),
        sums_(blocks * layout.disparities * lanes) {}

  /// The next advance() gives row y, those after it y + direction, ...
  void begin(size_t first_block, size_t y, int direction) {
    x_ = static_cast<ptrdiff_t>(first_block * lanes);
    direction_ = direction;
    y_ = static_cast<ptrdiff_t>(y) + direction * static_cast<ptrdiff_t>(block_height_ / 2);
    slot_ = 0;
    std::fill_n(history_.data(), block_height_ * layout_.disparities * columns * (narrow_ ? 1 : 2), uint8_t{0});
    std::fill_n(sums_.data(), blocks * layout_.disparities * lanes, T{0});
    y_ -= direction * static_cast<ptrdiff_t>(block_height_ - 1);
    for (size_t k = 1; k < block_height_; ++k) advance(sums_.data(), pitch(), sums_.data(), pitch());
  }

  /// The sums kept inside, [block][d][lanes].
  void advance(size_t) { advance(sums_.data(), pitch(), sums_.data(), pitch()); }
  HWY_INLINE StoredCosts<T> costs(size_t block) const { return {sums_.data() + block * pitch()}; }
  [[nodiscard]] const T* sums() const { return sums_.data(); }
  [[nodiscard]] size_t pitch() const { return layout_.disparities * lanes; }

  /// next = previous, one row on; pitches are from block to block.
  void advance(const T* previous, size_t previous_pitch, T* next, size_t next_pitch) {
    const size_t row = static_cast<size_t>(std::clamp<ptrdiff_t>(y_, 0, static_cast<ptrdiff_t>(layout_.height) - 1));
    for (size_t d = 0; d < layout_.disparities; d += batch) {
      const size_t count = std::min(batch, layout_.disparities - d);
      switch (left_.plane_count()) {
        case 3:
          hamming<3>(row, d, count);
          break;
        case 4:
          hamming<4>(row, d, count);
          break;
        case 6:
          hamming<6>(row, d, count);
          break;
        default:
          hamming<8>(row, d, count);
      }
      for (size_t k = 0; k < count; ++k) {
        const size_t at = (d + k) * lanes;
        if (narrow_) {
          replace_row<uint8_t>(d + k, hamming_.data() + k * hamming_pitch, previous + at, previous_pitch, next + at, next_pitch);
        } else {
          replace_row<uint16_t>(d + k, hamming_.data() + k * hamming_pitch, previous + at, previous_pitch, next + at, next_pitch);
        }
      }
    }
    slot_ = slot_ + 1 == block_height_ ? 0 : slot_ + 1;
    y_ += direction_;
  }

 private:
  static constexpr size_t batch = 16;                          // disparities at once: the left image's bytes stay in registers
  static constexpr size_t hamming_pitch = columns + 256 + 64;  // a chunk, the widest block, a vector

  /// Costs of `count` disparities from d at one row, columns x_ - block_width / 2 onwards.
  template <size_t planes>
  void hamming(size_t row, size_t d, size_t count) {
    const ptrdiff_t first = x_ - static_cast<ptrdiff_t>(block_width_ / 2);
    const size_t length = columns + block_width_ - 1;
    for (size_t i = 0; i < length; i += lane_count<uint8_t>) {
      const ColumnCosts<planes> costs(left_, right_, first + static_cast<ptrdiff_t>(i), row);
      for (size_t k = 0; k < count; ++k) hn::StoreU(costs(d + k), Lanes<uint8_t>(), hamming_.data() + k * hamming_pitch + i);
    }
    const size_t before = first < 0 ? static_cast<size_t>(-first) : 0;
    const size_t inside = static_cast<size_t>(static_cast<ptrdiff_t>(layout_.width) - first);
    if (before == 0 && inside >= length) return;
    for (size_t k = 0; k < count; ++k) {
      uint8_t* costs = hamming_.data() + k * hamming_pitch;
      std::fill_n(costs, before, costs[before]);
      if (inside < length) std::fill(costs + inside, costs + length, costs[inside - 1]);
    }
  }

  /// Sums of block_width_ neighbours. Every partial sum fits H.
  template <class H>
  HWY_INLINE void sum_across(const uint8_t* costs, H* sums) const {
    const Lanes<H> tag;
    for (size_t i = 0; i < columns; i += lane_count<H>) {
      const hn::Rebind<uint8_t, Lanes<H>> cost_tag;
      auto sum = widen<H>(hn::LoadU(cost_tag, costs + i));
      for (size_t k = 1; k < block_width_; ++k) sum = hn::Add(sum, widen<H>(hn::LoadU(cost_tag, costs + i + k)));
      hn::Store(sum, tag, sums + i);
    }
  }

  template <class H>
  HWY_INLINE void replace_row(size_t d, const uint8_t* costs, const T* previous, size_t previous_pitch, T* next, size_t next_pitch) {
    H* entering = reinterpret_cast<H*>(fresh_.data());
    H* leaving = reinterpret_cast<H*>(history_.data()) + (slot_ * layout_.disparities + d) * columns;
    sum_across<H>(costs, entering);
    const Lanes<T> tag;
    const hn::Rebind<H, Lanes<T>> history_tag;
    for (size_t block = 0; block < blocks; ++block) {
      const auto fresh = hn::LoadU(history_tag, entering + block * lanes), old = hn::LoadU(history_tag, leaving + block * lanes);
      const auto less = hn::Sub(hn::Load(tag, previous + block * previous_pitch), widen<T>(old));
      hn::Store(hn::Add(less, widen<T>(fresh)), tag, next + block * next_pitch);
      hn::StoreU(fresh, history_tag, leaving + block * lanes);
    }
  }

  template <class To, class V>
  static HWY_INLINE Vector<To> widen(V narrow) {
    if constexpr (sizeof(To) == sizeof(hn::TFromV<V>)) {
      return narrow;
    } else {
      return hn::PromoteTo(Lanes<To>(), narrow);
    }
  }

  const CensusPlanes& left_;
  const CensusPlanes& right_;
  const Layout& layout_;
  size_t block_width_, block_height_;
  bool narrow_;              // a row's sum fits a byte
  ptrdiff_t x_ = 0, y_ = 0;  // first column of the chunk; the row that enters next, possibly outside the image
  int direction_ = 1;
  size_t slot_ = 0;
  Buffer<uint8_t> hamming_;  // [batch][hamming_pitch]
  Buffer<uint16_t> fresh_;   // sums across of the entering row
  Buffer<uint8_t> history_;  // [block_height][d][columns] sums across of the rows inside the block, bytes or 16 bit
  Buffer<T> sums_;           // [block][d][lanes]
};

/// The cost source of the wider engines.
template <class T>
struct BlockCost {
  using Lane = T;
  static constexpr bool in_memory = true;
  using Sweep = BlockSweep<T>;

  /// A strip of rows: column layout for the whole strip, row layout for the tile at hand.
  class Strip {
   public:
    Strip(const CensusPlanes& left, const CensusPlanes& right, const MatchParameters& p, const Layout& layout)
        : layout_(layout),
          sweep_(left, right, p, layout),
          sums_(round_up(layout.blocks, Sweep::blocks) * lanes * row_pitch()),
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
};

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
