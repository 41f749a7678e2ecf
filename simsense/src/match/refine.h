// SPDX-License-Identifier: Apache-2.0
// The refinement of a disparity map by the images' counts (Lucas and Kanade 1981), as all back ends do it.
//
// Both images are cubic B-splines with the counts as coefficients. Such a spline is a blur that has hardly any frequency left that a shift
// by a fraction of a pixel would fold over, so that the fraction does not pull; interpolating filters do. W is the right spline at the
// pixel's match, e = W - left spline, w = dW/dx, g = the left image's slope over five columns. Where all of a window is s px off, e = s w:
//   s = (sum g e - sum g sum e / n) / (sum g w - sum g sum w / n + prior n);  the subtraction lets the two images differ by a constant.
// A sum of cells with texture t weighs its step by t^2 / (t^2 + prior^2): t / (t + prior) left a fifth of the pull on faint walls.
// Vignetting stands still in both images, a pattern of disparity 0: the slope over nine columns is taken from g, so that brightness which
// varies slowly has no say. Noise of g and w is not common to both, so that it does not make the step too short. Each pixel is looked at
// where its own disparity says, so that a window that sees two surfaces corrects both.
// First cells of 16 x 16 px, summed over 3 x 3 cells and interpolated between their middles, take a whole wall to its place though single
// windows drown in noise. A turned wall has all fractions of a pixel within a cell, which are pulled either way: the cells fit
// e = (s + p u) w, where u is the shape that the pull of matched costs has by a disparity's fraction on rendered walls, the same for all
// presets and sizes. From there a window's mean disparity, where it is less than half a pixel off, and its s give the result; a pixel
// whose match lies at the right image's border keeps its own.
//
// Sums are of integers, so that their order does not matter: g and w in 8ths of a count per pixel, e in 48ths. Counts have 8 bits, and
// those of wider images 12. A disparity stands in 32nds of a pixel while it is refined.
#pragma once

#include <algorithm>
#include <cstdint>

#include "shared/refine_push.h"

namespace simsense {

/// Bits by which the refinement's counts are finer than 8-bit counts.
constexpr uint32_t refine_extra_bits(uint32_t element_bytes) { return element_bytes == 1 ? 0 : 4; }

/// Converts a count to the refinement's unit: 8 bits, or 12 bits for wider images.
constexpr uint32_t refine_count(uint32_t count, uint32_t element_bytes, uint32_t bits) {
  if (element_bytes == 1) return count;
  return std::min(bits < 12 ? count << (12 - bits) : count >> (bits - 12), 4095u);
}

}  // namespace simsense
