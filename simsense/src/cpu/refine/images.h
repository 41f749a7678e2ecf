// SPDX-License-Identifier: Apache-2.0
// The pair that a refinement looks at.
#pragma once

#include "match/matcher.h"
#include "match/refine.h"

namespace simsense::cpu {

/// Reads row y of an image in the refinement's unit. bits: of a count.
inline void read_counts(const ConstImage& image, size_t y, size_t width, uint32_t bits, uint16_t* counts) {
  const ptrdiff_t first = static_cast<ptrdiff_t>(y) * image.row_stride;
  if (image.element_bytes == 1) {
    for (size_t x = 0; x < width; ++x) counts[x] = image.data[first + static_cast<ptrdiff_t>(x)];
  } else {
    const auto* row = reinterpret_cast<const uint16_t*>(image.data) + first;
    for (size_t x = 0; x < width; ++x) counts[x] = static_cast<uint16_t>(refine_count(row[x], 2, bits));
  }
}

struct RefineImages {
  ConstImage left, right;
  size_t width, height;
  uint32_t bits[2];
  float invalid, least_disparity;

  [[nodiscard]] uint32_t extra_bits() const { return refine_extra_bits(left.element_bytes); }

  /// Reads row y of the left (0) or right (1) image.
  void read(size_t side, size_t y, uint16_t* counts) const { read_counts(side == 0 ? left : right, y, width, bits[side], counts); }
};

}  // namespace simsense::cpu
