// SPDX-License-Identifier: Apache-2.0
#include "cpu/checks/median.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cpu/checks/median.cpp"
#include "cpu/simd/targets.h"
// after targets.h
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <class V>
HWY_INLINE void sort_pair(V& low, V& high) {
  const V least = hn::Min(low, high);
  high = hn::Max(low, high);
  low = least;
}

/// By odd-even transpositions.
template <size_t count, class V>
HWY_INLINE void sort(V (&values)[count]) {
  for (size_t pass = 0; pass < count; ++pass)
    for (size_t k = pass % 2; k + 1 < count; k += 2) sort_pair(values[k], values[k + 1]);
}

/// Forgetful selection: of half of the values and two more, the least and the greatest cannot be the median: they leave, and the next value
/// enters.
template <size_t count, class V>
HWY_INLINE V median_of(const V (&values)[count]) {
  constexpr size_t most_kept = count / 2 + 2;
  V kept[most_kept];
  for (size_t k = 0; k < most_kept; ++k) kept[k] = values[k];
  for (size_t live = most_kept;; --live) {
    for (size_t k = 0; k < live / 2; ++k) sort_pair(kept[k], kept[live - 1 - k]);
    for (size_t k = 1; k < (live + 1) / 2; ++k) sort_pair(kept[0], kept[k]);
    for (size_t k = live / 2; k + 1 < live; ++k) sort_pair(kept[k], kept[live - 1]);
    if (live == 3) return kept[1];
    kept[0] = values[2 * most_kept - live];
  }
}

/// In a square with sorted columns whose rows were sorted after them, as many values as (row + 1) (column + 1) are no greater than this
/// one.
constexpr bool may_be_median(size_t size, size_t row, size_t column) {
  const size_t rank = size * size / 2 + 1;
  return (row + 1) * (column + 1) <= rank && (size - row) * (size - column) <= rank;
}

constexpr size_t candidates(size_t size) {
  size_t count = 0;
  for (size_t i = 0; i < size * size; ++i) count += may_be_median(size, i / size, i % size);
  return count;
}

/// The medians of windows whose sorted columns begin at `sorted`, [rank][column]; as many values leave above the median as below it.
template <size_t size, class Tag>
HWY_INLINE hn::Vec<Tag> window_median(Tag tag, const float* sorted, size_t pitch) {
  hn::Vec<Tag> left[candidates(size)];
  size_t next = 0;
  for (size_t row = 0; row < size; ++row) {
    hn::Vec<Tag> values[size];
    for (size_t column = 0; column < size; ++column) values[column] = hn::LoadU(tag, sorted + row * pitch + column);
    sort(values);
    for (size_t column = 0; column < size; ++column)
      if (may_be_median(size, row, column)) left[next++] = values[column];
  }
  return median_of(left);
}

template <size_t size, class Tag>
HWY_INLINE void sort_columns(Tag tag, const float* top, size_t pitch, float* sorted) {
  hn::Vec<Tag> values[size];
  for (size_t row = 0; row < size; ++row) values[row] = hn::LoadU(tag, top + row * pitch);
  sort(values);
  for (size_t row = 0; row < size; ++row) hn::StoreU(values[row], tag, sorted + row * pitch);
}

/// run(tag, x) for all of [0, count), at some x twice.
template <class Run>
HWY_INLINE void for_lanes(size_t count, const Run& run) {
  const hn::CappedTag<float, 16> tag;
  const hn::CappedTag<float, 1> one;
  const size_t lanes = hn::Lanes(tag);
  for (size_t x = 0; count >= lanes && x < count; x += lanes) run(tag, HWY_MIN(x, count - lanes));
  for (size_t x = 0; count < lanes && x < count; ++x) run(one, x);
}

/// Interior columns of one row; `corner` is the top left value of the first window, `sorted` has room for size rows.
template <size_t size>
void median_row(const float* corner, size_t pitch, size_t count, float* sorted, float* filtered) {
  for_lanes(count + size - 1, [=](auto tag, size_t x) HWY_ATTR { sort_columns<size>(tag, corner + x, pitch, sorted + x); });
  for_lanes(count, [=](auto tag, size_t x) HWY_ATTR { hn::StoreU(window_median<size>(tag, sorted + x, pitch), tag, filtered + x); });
}

void median_interior(size_t size, const float* corner, size_t pitch, size_t count, float* sorted, float* filtered) {
  if (size == 3) median_row<3>(corner, pitch, count, sorted, filtered);
  if (size == 5) median_row<5>(corner, pitch, count, sorted, filtered);
  if (size == 7) median_row<7>(corner, pitch, count, sorted, filtered);
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <algorithm>
#include <vector>

namespace simsense::cpu {

HWY_EXPORT(median_interior);

void median_rows(const float* disparity, size_t width, size_t height, size_t size, size_t first_row, size_t end_row, float* filtered) {
  const size_t half = size / 2;
  std::vector<float> sorted(size * width);
  for (size_t y = first_row; y < end_row; ++y) {
    const float* in = disparity + y * width;
    float* out = filtered + y * width;
    if (half == 0 || y < half || y + half >= height) {
      std::copy_n(in, width, out);
      continue;
    }
    std::copy_n(in, half, out);
    std::copy_n(in + width - half, half, out + width - half);
    HWY_DYNAMIC_DISPATCH(median_interior)(size, in - half * width, width, width - 2 * half, sorted.data(), out + half);
  }
}

}  // namespace simsense::cpu
#endif
