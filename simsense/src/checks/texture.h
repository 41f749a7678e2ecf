// SPDX-License-Identifier: Apache-2.0
// Where the left image shows nothing. Plain values.
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

}  // namespace simsense
