// SPDX-License-Identifier: Apache-2.0
// Properties of the left image that explain a missing measurement. Plain values.
#pragma once

#include <cstdint>

namespace simsense {

struct ReasonParameters {
  uint32_t window_width = 7, window_height = 7;  // that of the census
  uint32_t low_texture_dn = 0;                   // a window whose grey levels span no more than this has too little texture
  uint32_t saturated_dn = 255;                   // the imager's largest count; at least half of the window must have it
};

}  // namespace simsense
