// SPDX-License-Identifier: Apache-2.0
// Where the left image shows nothing. Plain values.
#pragma once

#include <cstdint>

#include "shared/map_push.h"

namespace simsense {

/// A square of TEXTURE_SIDE pixels is blank where no two of its counts differ by at least min_texture_dn. Dots of a projector lie 12 pixels
/// apart, so that gaps between them hold no such square. What lies up to TEXTURE_EDGE pixels inside of a blank square is near enough to
/// texture to be measured.
struct TextureParameters {
  uint32_t min_texture_dn = 0;  // 0 = off
  static constexpr uint32_t window_reach = TEXTURE_SIDE / 2, drop_reach = TEXTURE_SIDE / 2 - TEXTURE_EDGE;
};

}  // namespace simsense
