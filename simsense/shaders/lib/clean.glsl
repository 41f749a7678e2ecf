// SPDX-License-Identifier: Apache-2.0
// Pixels that lose their measurement after the matcher.
#ifndef SIMSENSE_CLEAN_GLSL
#define SIMSENSE_CLEAN_GLSL
#include "shared/clean_push.h"

layout(push_constant, scalar) uniform Push { CleanPush push; };

void drop(uint pixel, uint why) {
  push.disparity.at[pixel] = push.invalid;
  if ((push.maps & MAPS_CONFIDENCE) != 0u) push.confidence.at[pixel] = 0.0f;
  if ((push.maps & MAPS_REASON) != 0u) push.reason.at[pixel] = uint8_t(why);
}
#endif
