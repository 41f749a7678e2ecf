// SPDX-License-Identifier: Apache-2.0
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

#include "cpu/cost/block_cost-inl.h"
#include "cpu/cost/hamming_cost-inl.h"
#include "cpu/sgm/layout.h"
#include "cpu/sgm/path_step-inl.h"
#include "cpu/sgm/sgm.h"
#include "cpu/winner/winner_strip-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

/// States of vertical paths, [slot][block]: of upward paths at the bottom of each group of rows, of downward paths at the top of each band.
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

/// A band of strips, which one worker matches.
template <class Cost>
class Band {
  using T = typename Cost::Lane;
  static constexpr size_t lanes = lane_count<T>, column_group = std::min<size_t>(16, lanes);

 public:
  Band(const CensusPlanes& left, const CensusPlanes& right, const Shared<T>& shared, VerticalStates<T>& states)
      : shared_(shared),
        states_(states),
        layout_(shared.layout),
        disparities_(layout_.disparities),
        state_size_(states.size()),
        costs_(left, right, shared.parameters, layout_),
        leftward_(round_up(layout_.width, column_group) / column_group * state_size_),
        path_state_(state_size_),
        rightward_state_(state_size_),
        across_(lanes * across_pitch()),
        up_(layout_.max_group_rows() * pixel()),
        stash_(std::max(layout_.max_group_rows(), column_group) * pixel()),
        jump_rows_(shared.penalties.uniform() ? 0 : (layout_.blocks + 1) * lanes * lanes),
        winners_(shared) {}

  void match(size_t band, const MatchMaps& maps, Progress& progress) {
    const Range strips = layout_.band_strips(band);
    for (size_t s = strips.begin; s < strips.end && progress.go_on(s == strips.begin ? 0 : 1); ++s) {
      rows_ = layout_.strip(s);
      costs_.begin(rows_);
      if (!shared_.penalties.uniform()) gather_jump_rows();
      leave_leftward_states();
      enter_image(disparities_, rightward_state_.data());
      winners_.begin(rows_, maps.confidence != nullptr);
      for (size_t block = 0; block < layout_.blocks; ++block) {
        horizontal_paths(block);
        for (size_t g = s * layout_.groups_per_strip; g < (s + 1) * layout_.groups_per_strip; ++g) vertical_paths(band, g, block);
      }
      winners_.finish(maps);
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
  /// P2 between columns x - 1 and x, for the strip's rows.
  HWY_INLINE Vector<T> jump_across(size_t x) const {
    return shared_.penalties.uniform() ? hn::Set(Lanes<T>(), shared_.penalties.p2)
                                       : shared_.penalties.scaled(jump_rows_.data() + x * lanes);
  }

  void gather_jump_rows() {
    for (size_t x = 0; x <= layout_.width; ++x) {
      for (size_t i = 0; i < rows_.size(); ++i)
        jump_rows_.data()[x * lanes + i] = shared_.penalties.maps->row(from_left, rows_.begin + i)[x];
    }
  }

  /// Follows the strip's leftward paths and keeps their state at each group of columns.
  void leave_leftward_states() {
    T* state = path_state_.data();
    enter_image(disparities_, state);
    Pass pass;
    for (size_t block = layout_.blocks; block-- > 0;) {
      const Range columns = layout_.columns(block);
      costs_.begin_pass(block);
      for (size_t group = round_up(columns.end, column_group) / column_group; group-- > columns.begin / column_group;) {
        std::copy_n(state, state_size_, leftward_state(group));
        const Range in_group = column_range(group);
        for (size_t x = in_group.end; x-- > in_group.begin;) step(jump_across(x + 1), costs_.row_costs(x), state, pass);
      }
    }
  }

  /// Sums leftward and rightward m of one tile, and transposes them from row to column layout.
  void horizontal_paths(size_t block) {
    const Range columns = layout_.columns(block);
    costs_.begin_tile(block);
    for (size_t group = columns.begin / column_group; group * column_group < columns.end; ++group) {
      const Range in_group = column_range(group);
      T* leftward = leftward_state(group);
      for (size_t x = in_group.end; x-- > in_group.begin;) {
        T* m_row = across_.data() + (x - columns.begin) * across_pitch();
        keep_path(jump_across(x + 1), costs_.row_costs(x), leftward, m_row, x - in_group.begin);
      }
      for (size_t x = in_group.begin; x < in_group.end; ++x) {
        AddPath<T> add{across_.data() + (x - columns.begin) * across_pitch()};
        if constexpr (Cost::in_memory) {
          step(jump_across(x), costs_.row_costs(x), rightward_state_.data(), add);
        } else {
          step(jump_across(x), stashed(x - in_group.begin), rightward_state_.data(), add);
        }
      }
    }
    for (size_t d = 0; d < disparities_; ++d) {
      T* square = across_.data() + d * lanes;
      transpose(square, across_pitch(), square, across_pitch(), rows_.size());
    }
  }

  /// Follows upward paths through one group of rows, then downward ones; sums them and finds the winners.
  void vertical_paths(size_t band, size_t group, size_t block) {
    const Range rows = layout_.group(group);
    T* upward = path_state_.data();
    std::copy_n(states_.up(group, block), state_size_, upward);
    for (size_t y = rows.end; y-- > rows.begin;) {
      const auto p2 = shared_.penalties.columns(from_above, static_cast<ptrdiff_t>(block * lanes), y + 1);
      keep_path(p2, costs_.column_costs(block, y), upward, up_.data() + (y - rows.begin) * pixel(), y - rows.begin);
    }
    const PackedState<T> downward{states_.down(band, block)};
    for (size_t y = rows.begin; y < rows.end; ++y) {
      const MeanOfFour<T> mean{across_.data() + (y - rows_.begin) * across_pitch(), up_.data() + (y - rows.begin) * pixel()};
      if constexpr (Cost::in_memory) {
        winners_.sum_and_win(mean, costs_.column_costs(block, y), downward, from_above, block, y);
      } else {
        winners_.sum_and_win(mean, stashed(y - rows.begin), downward, from_above, block, y);
      }
    }
  }

  template <class CostAt, class Visit>
  HWY_INLINE void step(Vector<T> p2, const CostAt& cost, T* state, Visit& visit) {
    path_step(shared_.penalties.p1, p2, disparities_, cost, PackedState<T>{state}, visit);
  }

  /// Moves a path one pixel and keeps m. Costs that are computed on demand are kept, too.
  template <class CostAt>
  HWY_INLINE void keep_path(Vector<T> p2, const CostAt& cost, T* state, T* m_row, size_t stash_slot) {
    if constexpr (Cost::in_memory) {
      KeepPath<T> keep{m_row};
      step(p2, cost, state, keep);
    } else {
      KeepPathAndCost<T> keep{m_row, stash_.data() + stash_slot * pixel()};
      step(p2, cost, state, keep);
    }
  }
  StoredCosts<T> stashed(size_t slot) const { return {stash_.data() + slot * pixel()}; }

  const Shared<T>& shared_;
  VerticalStates<T>& states_;
  const Layout& layout_;
  size_t disparities_, state_size_;
  Range rows_{};
  typename Cost::Strip costs_;
  Buffer<T> leftward_;         // [column group] states
  Buffer<T> path_state_;       // the path being followed or replayed
  Buffer<T> rightward_state_;  // carried from tile to tile
  Buffer<T> across_;           // sum of m of both horizontal paths in a tile: [column][d][row], then [row][d][column]
  Buffer<T> up_;               // m of the upward paths in a group: [row][d][column]
  Buffer<T> stash_;            // costs of a replayed group
  Buffer<uint8_t> jump_rows_;  // [column][row] P2 per pixel of the block, unless it is one everywhere
  WinnerStrip<T> winners_;
};

template <class Cost>
class Sgm final : public Aggregation {
  using T = typename Cost::Lane;
  static constexpr size_t lanes = lane_count<T>;

 public:
  Sgm(const CensusPlanes& left, const CensusPlanes& right, const PenaltyMaps& maps, size_t width, size_t height, const MatchParameters& p,
      size_t threads)
      : shared_(Layout(width, height, p.max_disparity, lanes, threads), p, maps), states_(shared_.layout) {
    const size_t directions = shared_.layout.bands > 1 ? 2 : 1;
    for (size_t i = 0; i < directions * chunks(); ++i) sweeps_.emplace_back(left, right, p, shared_.layout);
    for (size_t i = 0; i < shared_.layout.bands; ++i) bands_.emplace_back(left, right, shared_, states_);
    sweep_states_ = Buffer<T>(sweeps_.size() * Cost::Sweep::blocks * states_.size());
  }

  [[nodiscard]] size_t sweep_count() const override { return sweeps_.size(); }
  [[nodiscard]] size_t band_count() const override { return bands_.size(); }
  [[nodiscard]] size_t strip_count() const override { return shared_.layout.strips; }
  void match_band(size_t index, const MatchMaps& maps, Progress& progress) override { bands_[index].match(index, maps, progress); }

  void sweep(size_t index, Progress& progress) override {
    if (index < chunks()) {
      sweep_up(index, progress);
    } else {
      sweep_down(index, progress);
    }
    progress.go_on(1);
  }

 private:
  [[nodiscard]] size_t chunks() const { return round_up(shared_.layout.blocks, Cost::Sweep::blocks) / Cost::Sweep::blocks; }
  [[nodiscard]] Range chunk_blocks(size_t chunk) const {
    return {chunk * Cost::Sweep::blocks, std::min(shared_.layout.blocks, (chunk + 1) * Cost::Sweep::blocks)};
  }
  T* sweep_state(size_t index, size_t block) { return sweep_states_.data() + (index * Cost::Sweep::blocks + block) * states_.size(); }

  /// Moves the paths of these blocks to row y. jump_row: the row whose penalties hold between y and the row before it.
  void step_row(size_t index, size_t y, size_t jump_row, Range blocks) {
    auto& costs = sweeps_[index];
    costs.advance(y);
    Pass pass;
    for (size_t k = 0; k < blocks.size(); ++k) {
      const auto p2 = shared_.penalties.columns(from_above, static_cast<ptrdiff_t>((blocks.begin + k) * lanes), jump_row);
      path_step(shared_.penalties.p1, p2, shared_.layout.disparities, costs.costs(k), PackedState<T>{sweep_state(index, k)}, pass);
    }
  }

  /// Follows upward paths and keeps their state at each group of rows.
  void sweep_up(size_t index, Progress& progress) {
    const Layout& layout = shared_.layout;
    const Range blocks = chunk_blocks(index);
    sweeps_[index].begin(blocks.begin, layout.height - 1, -1);
    for (size_t k = 0; k < blocks.size(); ++k) enter_image(layout.disparities, sweep_state(index, k));
    for (size_t group = layout.groups(); group-- > 0;) {
      for (size_t k = 0; k < blocks.size(); ++k) {
        std::copy_n(sweep_state(index, k), states_.size(), states_.up(group, blocks.begin + k));
      }
      if (group == 0 || !progress.go_on(0)) break;
      const Range rows = layout.group(group);
      for (size_t y = rows.end; y-- > rows.begin;) step_row(index, y, y + 1, blocks);
    }
    for (size_t block = blocks.begin; block < blocks.end; ++block) enter_image(layout.disparities, states_.down(0, block));
  }

  /// Follows downward paths and keeps their state at each band but the first.
  void sweep_down(size_t index, Progress& progress) {
    const Layout& layout = shared_.layout;
    const Range blocks = chunk_blocks(index - chunks());
    sweeps_[index].begin(blocks.begin, 0, 1);
    for (size_t k = 0; k < blocks.size(); ++k) enter_image(layout.disparities, sweep_state(index, k));
    size_t y = 0;
    for (size_t band = 1; band < layout.bands; ++band) {
      for (; y < layout.band_first_row(band); ++y) {
        if (y % layout.max_strip_rows() == 0 && !progress.go_on(0)) return;
        step_row(index, y, y, blocks);
      }
      for (size_t k = 0; k < blocks.size(); ++k) {
        std::copy_n(sweep_state(index, k), states_.size(), states_.down(band, blocks.begin + k));
      }
    }
  }

  Shared<T> shared_;
  VerticalStates<T> states_;
  std::vector<typename Cost::Sweep> sweeps_;
  std::vector<Band<Cost>> bands_;
  Buffer<T> sweep_states_;
};

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
