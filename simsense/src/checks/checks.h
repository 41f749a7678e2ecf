// SPDX-License-Identifier: Apache-2.0
// Parameters of the checks after the matcher. Plain values.
#pragma once

#include <cstdint>

#include "shared/map_push.h"

namespace simsense {

/// A square of TEXTURE_SIDE pixels is blank if all its counts differ by less than min_texture_dn. Dots of a projector lie 12 pixels apart,
/// so the gaps between them hold no such square. The outer TEXTURE_EDGE pixels of a blank square are near enough to texture to be measured.
struct TextureParameters {
  uint32_t min_texture_dn = 0;  // 0 = off
  static constexpr uint32_t window_reach = TEXTURE_SIDE / 2, drop_reach = TEXTURE_SIDE / 2 - TEXTURE_EDGE;
};

/// Rejects measurements as depth cameras do: beside a step of depth, and where the match lies near the right image's left or right edge.
struct EdgeParameters {
  float step_px = 0;       // of disparity between neighbours, from which on both go; 0 = off
  uint32_t border_px = 0;  // width of the right image's edges in which no match lies; 0 = off
  [[nodiscard]] bool is_on() const { return step_px > 0 || border_px > 0; }
};

/// Properties of the left image that explain a missing measurement.
struct ReasonParameters {
  uint32_t window_width = 7, window_height = 7;  // that of the census
  uint32_t low_texture_dn = 0;                   // a window whose grey levels span no more than this has too little texture
  uint32_t saturated_dn = 255;                   // the imager's largest count; at least half of the window must have it
};

}  // namespace simsense
