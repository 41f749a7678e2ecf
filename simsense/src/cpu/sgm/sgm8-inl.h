// SPDX-License-Identifier: Apache-2.0
// Eight-path semi-global matching. Diagonal paths cross every tile, so strips of rows are done as a whole: the sum of m of a strip is kept
// in memory while the horizontal paths, then the three upward ones (replayed from a checkpoint below the strip), then the three downward
// ones pass over it.
#if defined(SIMSENSE_CPU_SGM8_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_SGM8_INL_H_
#undef SIMSENSE_CPU_SGM8_INL_H_
#else
#define SIMSENSE_CPU_SGM8_INL_H_
#endif

#include <vector>

#include "cpu/cost/block_cost-inl.h"
#include "cpu/sgm/diagonal_states-inl.h"
#include "cpu/sgm/sgm.h"
#include "cpu/winner/winner_strip-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

/// States of row paths: of upward ones at the bottom of each strip, of downward ones at the top of each band.
template <class T>
struct RowCheckpoints {
  std::vector<RowStates<T>> up, down;
  explicit RowCheckpoints(const Layout& layout) {
    for (size_t s = 0; s < layout.strips; ++s) up.emplace_back(layout);
    for (size_t b = 0; b < layout.bands; ++b) down.emplace_back(layout);
  }
};

/// Follows three row paths over whole rows.
template <class T>
class RowSweep {
 public:
  RowSweep(const CensusPlanes& left, const CensusPlanes& right, const Shared<T>& shared) : shared_(shared), states_(shared.layout) {
    const size_t chunks = round_up(shared.layout.blocks, BlockSweep<T>::blocks) / BlockSweep<T>::blocks;
    for (size_t i = 0; i < chunks; ++i) costs_.emplace_back(left, right, shared.parameters, shared.layout);
  }

  void up(RowCheckpoints<T>& checkpoints, Progress& progress) {
    const Layout& layout = shared_.layout;
    begin(layout.height - 1, -1);
    for (size_t s = layout.strips; s-- > 0;) {
      checkpoints.up[s].copy_from(states_);
      if (s == 0 || !progress.go_on(0)) break;
      const Range rows = layout.strip(s);
      for (size_t y = rows.end; y-- > rows.begin;) step_row(y, false);
    }
    checkpoints.down[0].enter_image();
  }

  void down(RowCheckpoints<T>& checkpoints, Progress& progress) {
    const Layout& layout = shared_.layout;
    begin(0, 1);
    size_t y = 0;
    for (size_t band = 1; band < layout.bands; ++band) {
      for (; y < layout.band_first_row(band); ++y) {
        if (y % layout.max_strip_rows() == 0 && !progress.go_on(0)) return;
        step_row(y, true);
      }
      checkpoints.down[band].copy_from(states_);
    }
  }

 private:
  void begin(size_t y, int direction) {
    for (size_t i = 0; i < costs_.size(); ++i) costs_[i].begin(i * BlockSweep<T>::blocks, y, direction);
    states_.enter_image();
  }
  void step_row(size_t y, bool downwards) {
    for (auto& chunk : costs_) chunk.advance(y);
    Pass pass;
    for (size_t path = 0; path < 3; ++path) {
      for (size_t i = 0; i < shared_.layout.blocks; ++i) {
        const size_t block = states_.block_at(path, i);
        const auto p2 = row_path_penalty(shared_.penalties, path, downwards, block, y);
        const StoredCosts<T> costs = costs_[block / BlockSweep<T>::blocks].costs(block % BlockSweep<T>::blocks);
        path_step(shared_.penalties.p1, p2, shared_.layout.disparities, costs, states_.at(path, block), pass);
      }
    }
    states_.close_row();
  }

  const Shared<T>& shared_;
  std::vector<BlockSweep<T>> costs_;
  RowStates<T> states_;
};

/// A band of strips, which one worker matches.
template <class T>
class Band8 {
  static constexpr size_t lanes = lane_count<T>;

 public:
  Band8(const CensusPlanes& left, const CensusPlanes& right, const Shared<T>& shared, RowCheckpoints<T>& checkpoints)
      : shared_(shared),
        checkpoints_(checkpoints),
        layout_(shared.layout),
        disparities_(layout_.disparities),
        costs_(left, right, shared.parameters, layout_),
        horizontal_(path_state_size<T>(disparities_)),
        tile_(lanes * tile_pitch()),
        square_(lanes * lanes),
        sums_(layout_.max_strip_rows() * row_pitch()),
        jump_row_(lanes),
        upward_(layout_),
        winners_(shared) {}

  void match(size_t band, const MatchMaps& maps, Progress& progress) {
    const Range strips = layout_.band_strips(band);
    for (size_t s = strips.begin; s < strips.end && progress.go_on(s == strips.begin ? 0 : 1); ++s) {
      rows_ = layout_.strip(s);
      costs_.begin(rows_);
      horizontal_paths();
      upward_paths(s);
      winners_.begin(rows_, maps.confidence != nullptr);
      downward_paths(checkpoints_.down[band]);
      winners_.finish(maps);
    }
  }

 private:
  [[nodiscard]] size_t tile_pitch() const { return (disparities_ + 1) * lanes; }
  [[nodiscard]] size_t row_pitch() const { return layout_.blocks * tile_pitch(); }
  /// Summed m of one vector of pixels, [d][lanes].
  T* sums(size_t block, size_t y) { return sums_.data() + (y - rows_.begin) * row_pitch() + block * tile_pitch(); }

  Vector<T> jump_across(size_t x) {
    if (shared_.penalties.uniform()) return hn::Set(Lanes<T>(), shared_.penalties.p2);
    for (size_t i = 0; i < rows_.size(); ++i) jump_row_.data()[i] = shared_.penalties.maps->row(from_left, rows_.begin + i)[x];
    return shared_.penalties.scaled(jump_row_.data());
  }

  void horizontal_paths() {
    enter_image(disparities_, horizontal_.data());
    for (size_t block = 0; block < layout_.blocks; ++block) {
      const Range columns = layout_.columns(block);
      costs_.begin_tile(block);
      for (size_t x = columns.begin; x < columns.end; ++x) step_across(x, x, columns.begin);
      for (size_t d = 0; d < disparities_; ++d)
        transpose(tile_.data() + d * lanes, tile_pitch(), sums(block, rows_.begin) + d * lanes, row_pitch(), rows_.size());
    }
    enter_image(disparities_, horizontal_.data());
    for (size_t block = layout_.blocks; block-- > 0;) {
      const Range columns = layout_.columns(block);
      costs_.begin_tile(block);
      for (size_t x = columns.end; x-- > columns.begin;) step_across(x, x + 1, columns.begin);
      for (size_t d = 0; d < disparities_; ++d) add_transposed(block, d);
    }
  }

  void step_across(size_t x, size_t jump_column, size_t first_column) {
    KeepPath<T> keep{tile_.data() + (x - first_column) * tile_pitch()};
    path_step(shared_.penalties.p1, jump_across(jump_column), disparities_, costs_.row_costs(x), PackedState<T>{horizontal_.data()}, keep);
  }

  void add_transposed(size_t block, size_t d) {
    const Lanes<T> tag;
    transpose(tile_.data() + d * lanes, tile_pitch(), square_.data(), lanes, rows_.size());
    for (size_t i = 0; i < rows_.size(); ++i) {
      T* sum = sums(block, rows_.begin + i) + d * lanes;
      hn::Store(hn::Add(hn::Load(tag, sum), hn::Load(tag, square_.data() + i * lanes)), tag, sum);
    }
  }

  void upward_paths(size_t strip) {
    upward_.copy_from(checkpoints_.up[strip]);
    for (size_t y = rows_.end; y-- > rows_.begin;) {
      for (size_t path = 0; path < 3; ++path) add_row_path(upward_, path, false, y);
      upward_.close_row();
    }
  }

  void downward_paths(RowStates<T>& states) {
    for (size_t y = rows_.begin; y < rows_.end; ++y) {
      for (size_t path = 1; path < 3; ++path) add_row_path(states, path, true, y);
      for (size_t block = 0; block < layout_.blocks; ++block) {
        winners_.sum_and_win(MeanOfEight<T>{sums(block, y)}, costs_.column_costs(block, y), states.at(0, block), from_above, block, y);
      }
      states.close_row();
    }
  }

  void add_row_path(RowStates<T>& states, size_t path, bool downwards, size_t y) {
    for (size_t i = 0; i < layout_.blocks; ++i) {
      const size_t block = states.block_at(path, i);
      AddPath<T> add{sums(block, y)};
      const auto p2 = row_path_penalty(shared_.penalties, path, downwards, block, y);
      path_step(shared_.penalties.p1, p2, disparities_, costs_.column_costs(block, y), states.at(path, block), add);
    }
  }

  const Shared<T>& shared_;
  RowCheckpoints<T>& checkpoints_;
  const Layout& layout_;
  size_t disparities_;
  Range rows_{};
  StoredStrip<T> costs_;
  Buffer<T> horizontal_;
  Buffer<T> tile_;    // m of a horizontal path in a tile, [column][d][row]
  Buffer<T> square_;  // of one disparity, [row][column]
  Buffer<T> sums_;    // m of the paths so far, [row][block][d][column]
  Buffer<uint8_t> jump_row_;
  RowStates<T> upward_;
  WinnerStrip<T> winners_;
};

template <class T>
class Sgm8 final : public Aggregation {
 public:
  Sgm8(const CensusPlanes& left, const CensusPlanes& right, const PenaltyMaps& maps, size_t width, size_t height, const MatchParameters& p,
       size_t threads)
      : shared_(Layout(width, height, p.max_disparity, lane_count<T>, threads), p, maps), checkpoints_(shared_.layout) {
    for (size_t i = 0; i < (shared_.layout.bands > 1 ? 2 : 1); ++i) sweeps_.emplace_back(left, right, shared_);
    for (size_t i = 0; i < shared_.layout.bands; ++i) bands_.emplace_back(left, right, shared_, checkpoints_);
  }

  [[nodiscard]] size_t sweep_count() const override { return sweeps_.size(); }
  void sweep(size_t index, Progress& progress) override {
    if (index == 0) {
      sweeps_[0].up(checkpoints_, progress);
    } else {
      sweeps_[1].down(checkpoints_, progress);
    }
    progress.go_on(1);
  }
  [[nodiscard]] size_t band_count() const override { return bands_.size(); }
  [[nodiscard]] size_t strip_count() const override { return shared_.layout.strips; }
  void match_band(size_t index, const MatchMaps& maps, Progress& progress) override { bands_[index].match(index, maps, progress); }

 private:
  Shared<T> shared_;
  RowCheckpoints<T> checkpoints_;
  std::vector<RowSweep<T>> sweeps_;
  std::vector<Band8<T>> bands_;
};

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
