// SPDX-License-Identifier: Apache-2.0
// Where a matcher's window sees two surfaces, or less than itself of the right image. Plain values.
#pragma once

#include <cstdint>

namespace simsense {

/// Rejects measurements as depth cameras do: beside a step of depth, and where the match lies near the right image's left or right edge.
struct EdgeParameters {
  float step_px = 0;       // of disparity between neighbours, from which on both go; 0 = off
  uint32_t border_px = 0;  // width of the right image's edges in which no match lies; 0 = off
  [[nodiscard]] bool is_on() const { return step_px > 0 || border_px > 0; }
};

}  // namespace simsense
