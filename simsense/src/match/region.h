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

/// The part to match for a region's disparities in an image of this size: they follow from its own columns and those that lie as far
/// to the left (or right) as the disparities reach, and from some surroundings that steer the paths.
Region reach(const Region& region, const MatchParameters& parameters, uint32_t width, uint32_t height);

}  // namespace simsense
