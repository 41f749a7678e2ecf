// SPDX-License-Identifier: Apache-2.0
// The check that both images show the same where a disparity stands, as all back ends do it.
//
// An image that shows nothing still has costs, and paths carry the disparities of things into it; counts of noise do not correlate.
// h is a count less the mean of a square about it, in 8ths of a count: brightness that varies slowly says nothing of disparities. It is
// bounded, so that a strong edge does not speak for all of a window. At x it meets the h of the right image's column x - disparity,
// rounded. Over the pixels of a window that have a disparity whose column is in the image,
//   sum h_l h_r >= c sqrt(sum h_l^2 sum h_r^2)
// must hold, the normalised cross-correlation (Lewis, Fast Normalized Cross-Correlation, Vision Interface 1995) without the means, which
// are near 0. A constant image has no h and fails. Sums are of integers; floats hold all of them exactly.
#pragma once

#include <cmath>
#include <cstdint>

#include "match/refine.h"
#include "shared/correlation_push.h"

namespace simsense {

/// Side of the square whose mean is taken from a count, px, odd.
constexpr uint32_t correlation_mean_side(uint32_t window) { return window / 2 | 1; }

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

/// Sums of a window: products of both images' h, and squares of each.
struct CorrelationSums {
  int32_t both = 0, left = 0, right = 0;
};

/// least: of the correlation.
inline bool correlates(const CorrelationSums& sums, float least) {
  const auto both = static_cast<float>(sums.both);
  const float share = least * least, left = share * static_cast<float>(sums.left);
  return sums.both > 0 && both * both >= left * static_cast<float>(sums.right);
}

}  // namespace simsense
