// Four-path semi-global matching without a stored volume. Sweeps follow the vertical paths once and leave their states at checkpoints; then
// each strip of rows is done tile by tile from left to right, replaying the upward and the leftward paths from the nearest checkpoint
// inside tiles that stay in the L2 cache. The downward path comes last and carries the sum and the winner with it.
#if defined(SIMSENSE_CPU_SGM_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_SGM_INL_H_
#undef SIMSENSE_CPU_SGM_INL_H_
#else
#define SIMSENSE_CPU_SGM_INL_H_
#endif

#include <algorithm>
#include <vector>

#include "cpu/block_cost-inl.h"
#include "cpu/hamming_cost-inl.h"
#include "cpu/layout.h"
#include "cpu/path_step-inl.h"
#include "cpu/sgm.h"
#include "cpu/subpixel-inl.h"
#include "cpu/winner-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

/// Vertical path states, [slot][block]: where upward paths enter a group of rows from below, where downward paths enter a band from above.
template <class T>
class VerticalStates {
 public:
  VerticalStates(const Layout& layout)
      : blocks_(layout.blocks),
        size_(path_state_size<T>(layout.disparities)),
        up_(layout.groups() * blocks_ * size_),
        down_(layout.bands * blocks_ * size_) {}
  T* up(size_t group, size_t block) { return up_.data() + (group * blocks_ + block) * size_; }
  T* down(size_t band, size_t block) { return down_.data() + (band * blocks_ + block) * size_; }
  [[nodiscard]] size_t size() const { return size_; }

 private:
  size_t blocks_, size_;
  Buffer<T> up_, down_;
};

/// What all workers share.
template <class T>
struct Shared {
  Layout layout;
  MatchParameters parameters;
  Penalties<T> penalties;
  std::vector<T> thresholds;
  VerticalStates<T> states;
};

/// One worker's band of strips.
template <class Cost>
class Band {
  using T = typename Cost::Lane;
  static constexpr size_t lanes = lane_count<T>, column_group = std::min<size_t>(16, lanes);

 public:
  Band(const CensusPlanes& left, const CensusPlanes& right, Shared<T>& shared)
      : shared_(shared),
        layout_(shared.layout),
        disparities_(layout_.disparities),
        state_size_(shared.states.size()),
        row_pitch_(layout_.blocks * lanes),
        right_pitch_(round_up(disparities_ + lanes, lanes) + row_pitch_),
        costs_(left, right, shared.parameters, layout_),
        leftward_(round_up(layout_.width, column_group) / column_group * state_size_),
        path_state_(state_size_),
        rightward_state_(state_size_),
        across_(lanes * across_pitch()),
        up_(layout_.max_group_rows() * pixel()),
        stash_(std::max(layout_.max_group_rows(), column_group) * pixel()),
        summed_(disparities_),
        winners_(8 * layout_.max_strip_rows() * row_pitch_),
        right_(2 * layout_.max_strip_rows() * right_pitch_),
        right_row_(row_pitch_ + 64),
        disparity_row_(row_pitch_ + 64) {}

  void match(size_t band, float* disparity) {
    const Range strips = layout_.band_strips(band);
    for (size_t s = strips.begin; s < strips.end; ++s) {
      rows_ = layout_.strip(s);
      costs_.begin(rows_);
      leave_leftward_states();
      enter_image(disparities_, rightward_state_.data());
      const size_t right_size = layout_.max_strip_rows() * right_pitch_;
      std::fill_n(right_.data(), right_size, hwy::LimitsMax<T>());
      std::fill_n(right_.data() + right_size, right_size, T{0});
      for (size_t block = 0; block < layout_.blocks; ++block) {
        horizontal_paths(block);
        for (size_t g = s * layout_.groups_per_strip; g < (s + 1) * layout_.groups_per_strip; ++g) vertical_paths(band, g, block);
      }
      finish(disparity);
    }
  }

 private:
  [[nodiscard]] size_t pixel() const { return disparities_ * lanes; }
  // one vector more than needed, so that a tile's pixels do not share cache sets
  [[nodiscard]] size_t across_pitch() const { return (disparities_ + 1) * lanes; }
  [[nodiscard]] Range column_range(size_t group) const {
    return {group * column_group, std::min(layout_.width, (group + 1) * column_group)};
  }
  T* leftward_state(size_t group) { return leftward_.data() + group * state_size_; }

  WinnerRow<T> winner_row(size_t y) {
    const size_t plane = layout_.max_strip_rows() * row_pitch_, right_plane = layout_.max_strip_rows() * right_pitch_;
    T* row = winners_.data() + (y - rows_.begin) * row_pitch_;
    T* right = right_.data() + (y - rows_.begin) * right_pitch_ + right_pitch_ - row_pitch_;
    return {row,   row + plane,        row + 2 * plane, row + 3 * plane, row + 4 * plane, row + 5 * plane, row + 6 * plane, row + 7 * plane,
            right, right + right_plane};
  }

  /// Follows the strip's leftward paths and leaves their state at each group of columns.
  void leave_leftward_states() {
    T* state = path_state_.data();
    enter_image(disparities_, state);
    Pass pass;
    for (size_t block = layout_.blocks; block-- > 0;) {
      const Range columns = layout_.columns(block);
      costs_.begin_tile(block);
      for (size_t group = round_up(columns.end, column_group) / column_group; group-- > columns.begin / column_group;) {
        std::copy_n(state, state_size_, leftward_state(group));
        const Range in_group = column_range(group);
        for (size_t x = in_group.end; x-- > in_group.begin;) path_step(shared_.penalties, disparities_, costs_.row_costs(x), state, pass);
      }
    }
  }

  /// Leftward plus rightward m of one tile, then from row layout to column layout.
  void horizontal_paths(size_t block) {
    const Range columns = layout_.columns(block);
    costs_.begin_tile(block);
    for (size_t group = columns.begin / column_group; group * column_group < columns.end; ++group) {
      const Range in_group = column_range(group);
      T* leftward = leftward_state(group);
      for (size_t x = in_group.end; x-- > in_group.begin;) {
        T* m_row = across_.data() + (x - columns.begin) * across_pitch();
        keep_path(costs_.row_costs(x), leftward, m_row, x - in_group.begin);
      }
      for (size_t x = in_group.begin; x < in_group.end; ++x) {
        AddPath<T> add{across_.data() + (x - columns.begin) * across_pitch()};
        if constexpr (Cost::in_memory) {
          path_step(shared_.penalties, disparities_, costs_.row_costs(x), rightward_state_.data(), add);
        } else {
          path_step(shared_.penalties, disparities_, stashed(x - in_group.begin), rightward_state_.data(), add);
        }
      }
    }
    for (size_t d = 0; d < disparities_; ++d) {
      T* square = across_.data() + d * lanes;
      transpose(square, across_pitch(), square, across_pitch(), rows_.size());
    }
  }

  /// Upward paths of one group of rows, then downward ones with sum and winner.
  void vertical_paths(size_t band, size_t group, size_t block) {
    const Range rows = layout_.group(group);
    T* upward = path_state_.data();
    std::copy_n(shared_.states.up(group, block), state_size_, upward);
    for (size_t y = rows.end; y-- > rows.begin;) {
      keep_path(costs_.column_costs(block, y), upward, up_.data() + (y - rows.begin) * pixel(), y - rows.begin);
    }
    T* downward = shared_.states.down(band, block);
    for (size_t y = rows.begin; y < rows.end; ++y) {
      if constexpr (Cost::in_memory) {
        sum_and_win(costs_.column_costs(block, y), downward, block, y, y - rows.begin);
      } else {
        sum_and_win(stashed(y - rows.begin), downward, block, y, y - rows.begin);
      }
    }
  }

  HWY_INLINE void sum_and_win(const StoredCosts<T>& cost, T* state, size_t block, size_t y, size_t row_in_group) {
    const Lanes<T> tag;
    SumAndWinner<T> winner(across_.data() + (y - rows_.begin) * across_pitch(), up_.data() + row_in_group * pixel(), summed_.row(0));
    path_step(shared_.penalties, disparities_, cost, state, winner);
    winner.finish();
    const WinnerRow<T> row = winner_row(y);
    const size_t x = block * lanes;
    hn::Store(winner.winner, tag, row.disparity + x);
    hn::Store(winner.before, tag, row.before + x);
    hn::Store(winner.lowest, tag, row.lowest + x);
    hn::Store(winner.after, tag, row.after + x);
    hn::Store(ambiguity(winner, disparities_, summed_.row(0), shared_.thresholds), tag, row.ambiguous + x);
    if (uses_block_costs(shared_.parameters)) {
      costs_around(row.disparity + x, cost.row, disparities_, row.block_before + x, row.block_lowest + x, row.block_after + x);
    }
    if (shared_.parameters.lr_max_diff < 0) return;
    const size_t inside = layout_.columns(block).size();
    if (inside < lanes) {  // no right pixel may match what lies beyond the last column
      for (size_t d = 0; d < disparities_; ++d) std::fill(summed_.row(d) + inside, summed_.row(d) + lanes, hwy::LimitsMax<T>());
    }
    offer_to_right(disparities_, summed_.row(0), row.right_lowest + x, row.right_disparity + x);
  }

  /// One step that keeps m, and the costs too where asking for them again would compute them again.
  template <class CostAt>
  HWY_INLINE void keep_path(const CostAt& cost, T* state, T* m_row, size_t stash_slot) {
    if constexpr (Cost::in_memory) {
      KeepPath<T> keep{m_row};
      path_step(shared_.penalties, disparities_, cost, state, keep);
    } else {
      KeepPathAndCost<T> keep{m_row, stash_.data() + stash_slot * pixel()};
      path_step(shared_.penalties, disparities_, cost, state, keep);
    }
  }
  StoredCosts<T> stashed(size_t slot) const { return {stash_.data() + slot * pixel()}; }

  void finish(float* disparity) {
    for (size_t y = rows_.begin; y < rows_.end; ++y) {
      finish_row(winner_row(y), layout_.width, shared_.parameters, right_row_.data(), disparity_row_.data());
      std::copy_n(disparity_row_.data(), layout_.width, disparity + y * layout_.width);
    }
  }

  Shared<T>& shared_;
  const Layout& layout_;
  size_t disparities_, state_size_, row_pitch_, right_pitch_;
  Range rows_{};
  typename Cost::Strip costs_;
  Buffer<T> leftward_;         // [column group] states
  Buffer<T> path_state_;       // the path being followed or replayed
  Buffer<T> rightward_state_;  // carried from tile to tile
  Buffer<T> across_;           // sum of m of both horizontal paths in a tile: [column][d][row], then [row][d][column]
  Buffer<T> up_;               // m of the upward paths in a group: [row][d][column]
  Buffer<T> stash_;            // costs of a replayed group
  SummedCosts<T> summed_;
  Buffer<T> winners_, right_;
  Buffer<int32_t> right_row_;
  Buffer<float> disparity_row_;
};

template <class Cost>
class Sgm final : public Aggregation {
  using T = typename Cost::Lane;
  static constexpr size_t lanes = lane_count<T>;

 public:
  Sgm(const CensusPlanes& left, const CensusPlanes& right, size_t width, size_t height, const MatchParameters& p, size_t threads)
      : Sgm(left, right, Layout(width, height, p.max_disparity, lanes, threads), p) {}

  [[nodiscard]] size_t sweep_count() const override { return sweeps_.size(); }
  [[nodiscard]] size_t band_count() const override { return bands_.size(); }
  void match_band(size_t index, float* disparity) override { bands_[index].match(index, disparity); }

  void sweep(size_t index) override {
    if (index < chunks()) {
      sweep_up(index);
    } else {
      sweep_down(index);
    }
  }

 private:
  Sgm(const CensusPlanes& left, const CensusPlanes& right, const Layout& layout, const MatchParameters& p)
      : area_(p.block_width * p.block_height),
        max_cost_(((p.census_width * p.census_height - 1) / 2 + p.p2) * area_),
        shared_{layout,
                p,
                {static_cast<T>(p.p1 * area_), static_cast<T>(p.p2 * area_)},
                uniqueness_thresholds<T>(p.uniqueness_ratio, max_cost_),
                VerticalStates<T>(layout)} {
    const size_t directions = shared_.layout.bands > 1 ? 2 : 1;
    for (size_t i = 0; i < directions * chunks(); ++i) sweeps_.emplace_back(left, right, p, shared_.layout);
    for (size_t i = 0; i < shared_.layout.bands; ++i) bands_.emplace_back(left, right, shared_);
    sweep_states_ = Buffer<T>(sweeps_.size() * Cost::Sweep::blocks * shared_.states.size());
  }

  [[nodiscard]] size_t chunks() const { return round_up(shared_.layout.blocks, Cost::Sweep::blocks) / Cost::Sweep::blocks; }
  [[nodiscard]] Range chunk_blocks(size_t chunk) const {
    return {chunk * Cost::Sweep::blocks, std::min(shared_.layout.blocks, (chunk + 1) * Cost::Sweep::blocks)};
  }
  T* sweep_state(size_t index, size_t block) {
    return sweep_states_.data() + (index * Cost::Sweep::blocks + block) * shared_.states.size();
  }

  void step_row(size_t index, size_t y, size_t block_count) {
    auto& costs = sweeps_[index];
    costs.advance(y);
    Pass pass;
    for (size_t k = 0; k < block_count; ++k) {
      path_step(shared_.penalties, shared_.layout.disparities, costs.costs(k), sweep_state(index, k), pass);
    }
  }

  /// Upward paths, saved where they enter each group of rows.
  void sweep_up(size_t index) {
    const Layout& layout = shared_.layout;
    const Range blocks = chunk_blocks(index);
    sweeps_[index].begin(blocks.begin, layout.height - 1, -1);
    for (size_t k = 0; k < blocks.size(); ++k) enter_image(layout.disparities, sweep_state(index, k));
    for (size_t group = layout.groups(); group-- > 0;) {
      for (size_t k = 0; k < blocks.size(); ++k) {
        std::copy_n(sweep_state(index, k), shared_.states.size(), shared_.states.up(group, blocks.begin + k));
      }
      if (group == 0) break;
      const Range rows = layout.group(group);
      for (size_t y = rows.end; y-- > rows.begin;) step_row(index, y, blocks.size());
    }
    for (size_t block = blocks.begin; block < blocks.end; ++block) enter_image(layout.disparities, shared_.states.down(0, block));
  }

  /// Downward paths, saved where they enter each band but the first.
  void sweep_down(size_t index) {
    const Layout& layout = shared_.layout;
    const Range blocks = chunk_blocks(index - chunks());
    sweeps_[index].begin(blocks.begin, 0, 1);
    for (size_t k = 0; k < blocks.size(); ++k) enter_image(layout.disparities, sweep_state(index, k));
    size_t y = 0;
    for (size_t band = 1; band < layout.bands; ++band) {
      for (; y < layout.band_first_row(band); ++y) step_row(index, y, blocks.size());
      for (size_t k = 0; k < blocks.size(); ++k) {
        std::copy_n(sweep_state(index, k), shared_.states.size(), shared_.states.down(band, blocks.begin + k));
      }
    }
  }

  size_t area_, max_cost_;
  Shared<T> shared_;
  std::vector<typename Cost::Sweep> sweeps_;
  std::vector<Band<Cost>> bands_;
  Buffer<T> sweep_states_;
};

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
