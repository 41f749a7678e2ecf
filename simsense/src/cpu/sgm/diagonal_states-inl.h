// SPDX-License-Identifier: Apache-2.0
// States of the three paths that go down (or up) an image: straight and both diagonals, for a whole row of pixels at a time.
#if defined(SIMSENSE_CPU_DIAGONAL_STATES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_DIAGONAL_STATES_INL_H_
#undef SIMSENSE_CPU_DIAGONAL_STATES_INL_H_
#else
#define SIMSENSE_CPU_DIAGONAL_STATES_INL_H_
#endif

#include <algorithm>

#include "cpu/sgm/layout.h"
#include "cpu/sgm/path_step-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

/// One of the three row paths: the column, from -1 to 1, of the previous row's pixel that it comes from.
struct RowPath {
  ptrdiff_t from;  // -1, 0, 1
};
constexpr RowPath row_paths[3] = {{0}, {-1}, {1}};

/// The states of a row's paths, [path][d, then `unreachable`, then the minimum][column]. Columns outside the image are zero, so that a path
/// starts there with L = C.
template <class T>
class RowStates {
 public:
  RowStates() = default;
  explicit RowStates(const Layout& layout)
      : layout_(&layout), pitch_((layout.blocks + 3) * lanes), size_((layout.disparities + 2) * pitch_), storage_(3 * size_) {
    enter_image();
  }

  void enter_image() {
    std::fill_n(storage_.data(), 3 * size_, T{0});
    for (size_t path = 0; path < 3; ++path)
      std::fill_n(storage_.data() + path * size_ + layout_->disparities * pitch_, pitch_, unreachable<T>);
  }
  void copy_from(const RowStates& other) { std::copy_n(other.storage_.data(), 3 * size_, storage_.data()); }

  /// Block number i of a path's order, in which no block overwrites the input of the next.
  [[nodiscard]] size_t block_at(size_t path, size_t i) const { return row_paths[path].from < 0 ? layout_->blocks - 1 - i : i; }
  SlantedState<T> at(size_t path, size_t block) {
    return {storage_.data() + path * size_ + (block + 1) * lanes, static_cast<ptrdiff_t>(pitch_), row_paths[path].from};
  }
  /// Sets the columns behind the image to zero again after the last vector of a row has written them.
  void close_row() {
    const size_t behind = lanes + layout_->width;
    for (size_t path = 0; path < 3; ++path) {
      for (size_t row = 0; row < layout_->disparities + 2; ++row) {
        if (row != layout_->disparities) storage_.data()[path * size_ + row * pitch_ + behind] = T{0};
      }
    }
  }

 private:
  static constexpr size_t lanes = lane_count<T>;
  const Layout* layout_ = nullptr;
  size_t pitch_ = 0, size_ = 0;
  Buffer<T> storage_;
};

/// P2 of a path's step to a vector of pixels of row y, from row y - 1 if downwards, else y + 1.
template <class T>
HWY_INLINE Vector<T> row_path_penalty(const Penalties<T>& penalties, size_t path, bool downwards, size_t block, size_t y) {
  const ptrdiff_t x = static_cast<ptrdiff_t>(block * lane_count<T>), from = row_paths[path].from;
  // the penalty between two pixels is kept with the lower one, under where the upper one lies
  const ptrdiff_t upper = downwards ? from : -from;
  const PathDirection direction = upper == 0 ? from_above : upper < 0 ? from_above_left : from_above_right;
  return downwards ? penalties.columns(direction, x, y) : penalties.columns(direction, x + from, y + 1);
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
