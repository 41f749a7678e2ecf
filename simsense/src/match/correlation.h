// SPDX-License-Identifier: Apache-2.0
// The check that both images show the same where a disparity stands, as all back ends do it.
//
// An image that shows nothing still has costs, and paths carry the disparities of things into it; counts of noise do not correlate.
// h is a count less the mean of a square about it, in 8ths of a count: brightness that varies slowly says nothing of disparities. It is
// bounded, so that a strong edge does not speak for all of a window. At x it meets the h of the right image's column x - disparity,
// rounded. Over the n pixels of a window that have a disparity whose column is in the image, and an h that is not 0,
//   c = sum h_l h_r / sqrt(sum h_l^2 sum h_r^2)
// is the normalised cross-correlation (Lewis, Fast Normalized Cross-Correlation, Vision Interface 1995) without the means, which are near
// 0. That of noise has the variance 1 / n, so that c sqrt(n) of a wide window tells a weak pattern from noise, however few pixels count.
// A wide window about an empty pixel sees the thing beside it. So a near one must correlate, too, by a share of c, within its own noise:
//   c_near |c_near| >= share^2 c^2 - noise^2 / n_near.
// A constant image has no h and fails. Sums are of integers; floats hold all of them exactly.
// What passes is a thing widened by the near window and by the square of the mean. Where 3 x 3 px fail by the near window, nothing is
// there, found or not, and the pixels that a thing is widened by go, too: a closing (Serra, Image Analysis and Mathematical Morphology,
// 1982).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "match/refine.h"
#include "shared/correlation_push.h"

namespace simsense {

/// Side of the square whose mean is taken from a count, px, odd.
constexpr uint32_t correlation_mean_side(uint32_t window) { return std::max(3u, 3 * window / 10 | 1); }

/// Side of the near window, px, odd.
constexpr uint32_t correlation_near_side(uint32_t window) { return window / 2 | 1; }

/// How far from the middle of 3 x 3 px without correlation a thing beside them is widened to, px.
constexpr uint32_t correlation_bare_reach(uint32_t window) {
  return correlation_near_side(window) / 2 + correlation_mean_side(window) / 2 + 1;
}

/// A pixel's part in the mean of a square of so many px a side, in 65536ths.
constexpr int32_t correlation_part(uint32_t mean_side) {
  const auto area = static_cast<int32_t>(mean_side * mean_side);
  return (65536 + area / 2) / area;
}

/// count, sum: of a pixel and the square about it, as the refinement reads counts; part: correlation_part(mean_side).
constexpr int32_t high_pass(int32_t count, int32_t sum, uint32_t mean_side, int32_t part, uint32_t extra_bits) {
  const int32_t difference = (static_cast<int32_t>(mean_side * mean_side) * count - sum) * 8 >> extra_bits;
  const int32_t h = (difference * part + 32768) >> 16;
  return h < -CORRELATION_LARGEST ? -CORRELATION_LARGEST : h > CORRELATION_LARGEST ? CORRELATION_LARGEST : h;
}

/// Column of the right image that a disparity of the left one's column x means.
inline int32_t matched_column(int32_t x, float disparity) { return x - static_cast<int32_t>(std::floor(disparity + 0.5f)); }

/// Sums of a window: products of both images' h, squares of each, and pixels that count.
struct CorrelationSums {
  int32_t both = 0, left = 0, right = 0, pixels = 0;
};

/// Whether either window has enough.
struct Correlates {
  bool wide, near;
};

/// least: of the correlation of a whole wide window, of so many px.
inline Correlates correlates(const CorrelationSums& wide, const CorrelationSums& near, float least, uint32_t area) {
  const auto both = static_cast<float>(wide.both), near_both = static_cast<float>(near.both);
  const auto count = static_cast<float>(wide.pixels), near_count = static_cast<float>(near.pixels);
  const float all = static_cast<float>(wide.left) * static_cast<float>(wide.right);
  const float near_all = static_cast<float>(near.left) * static_cast<float>(near.right);
  const float square = both * both, share = least * least * static_cast<float>(area);
  const float near_square = near_both * std::fabs(near_both) * near_count + CORRELATION_NOISE * near_all;
  return {wide.both > 0 && square * count >= share * all, near_square * all > CORRELATION_SHARE * square * near_all * near_count};
}

}  // namespace simsense
