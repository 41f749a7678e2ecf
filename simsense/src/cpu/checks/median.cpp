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

/// Forgetful selection: of the first n/2 + 2 values the lowest and the highest cannot be the median of n and leave; the next value enters.
template <size_t size, class Tag>
HWY_INLINE hn::Vec<Tag> window_median(Tag tag, const float* corner, size_t pitch) {
  constexpr size_t count = size * size, kept = count / 2 + 2;
  hn::Vec<Tag> values[kept];
  for (size_t k = 0; k < kept; ++k) values[k] = hn::LoadU(tag, corner + k / size * pitch + k % size);
  size_t next = kept;
  for (size_t live = kept; live > 2; --live) {
    for (size_t k = 1; k < live; ++k) {  // values[0] becomes the lowest
      const auto low = hn::Min(values[0], values[k]);
      values[k] = hn::Max(values[0], values[k]);
      values[0] = low;
    }
    for (size_t k = 1; k + 1 < live; ++k) {  // values[live - 1] becomes the highest
      const auto high = hn::Max(values[live - 1], values[k]);
      values[k] = hn::Min(values[live - 1], values[k]);
      values[live - 1] = high;
    }
    if (next == count) return values[1];
    values[0] = hn::LoadU(tag, corner + next / size * pitch + next % size);
    ++next;
  }
  return values[1];
}

/// Interior columns of one row; `corner` is the top left value of the first window.
template <size_t size>
void median_row(const float* corner, size_t pitch, size_t count, float* filtered) {
  const hn::CappedTag<float, 16> tag;
  const size_t lanes = hn::Lanes(tag);
  size_t x = 0;
  for (; x + lanes <= count; x += lanes) hn::StoreU(window_median<size>(tag, corner + x, pitch), tag, filtered + x);
  const hn::CappedTag<float, 1> one;
  for (; x < count; ++x) hn::StoreU(window_median<size>(one, corner + x, pitch), one, filtered + x);
}

void median_interior(size_t size, const float* corner, size_t pitch, size_t count, float* filtered) {
  if (size == 3) median_row<3>(corner, pitch, count, filtered);
  if (size == 5) median_row<5>(corner, pitch, count, filtered);
  if (size == 7) median_row<7>(corner, pitch, count, filtered);
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <algorithm>

namespace simsense::cpu {

HWY_EXPORT(median_interior);

void median_rows(const float* disparity, size_t width, size_t height, size_t size, size_t first_row, size_t end_row, float* filtered) {
  const size_t half = size / 2;
  for (size_t y = first_row; y < end_row; ++y) {
    const float* in = disparity + y * width;
    float* out = filtered + y * width;
    if (half == 0 || y < half || y + half >= height) {
      std::copy_n(in, width, out);
      continue;
    }
    std::copy_n(in, half, out);
    std::copy_n(in + width - half, half, out + width - half);
    HWY_DYNAMIC_DISPATCH(median_interior)(size, in - half * width, width, width - 2 * half, out + half);
  }
}

}  // namespace simsense::cpu
#endif
