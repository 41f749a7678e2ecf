// SPDX-License-Identifier: Apache-2.0
// The rectangle of the rectified left image whose disparities are wanted. Thread rule: pure functions.
#pragma once

#include <cstdint>

#include "match/matcher.h"

namespace simsense {

/// A rectangle of pixels, [x0, x1) x [y0, y1).
struct Region {
  uint32_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  bool operator==(const Region&) const = default;
};

/// Returns the part of an image that must be matched for a region's disparities: the region, the columns that its disparities reach, and a
/// margin for the paths.
Region reach(const Region& region, const MatchParameters& parameters, uint32_t width, uint32_t height);

}  // namespace simsense
