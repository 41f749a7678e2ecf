// SPDX-License-Identifier: Apache-2.0
// What the checks after the matcher (padding.h, speckle.h, holes.h) have in common: the disparities and maps they change, and their limits.
#pragma once

#include "shared/clean_push.h"
#include "stages/settings.h"
#include "vulkan/maps.h"

namespace simsense {

inline CleanPush clean_push(const StageSettings& settings, const DeviceMaps& maps, uint32_t width, uint32_t height) {
  CleanPush push{};
  push.disparity = maps.disparity;
  push.confidence = maps.confidence;
  push.reason = maps.reason;
  push.maps = maps.flags();
  push.width = width;
  push.height = height;
  push.invalid = settings.invalid_disparity();
  push.max_diff_px = settings.speckle_max_diff_px;
  push.max_size = settings.speckle_max_size;
  push.filling = static_cast<uint32_t>(settings.hole_filling);
  push.x0 = settings.wanted.x0;
  push.y0 = settings.wanted.y0;
  push.x1 = settings.wanted.x1;
  push.y1 = settings.wanted.y1;
  return push;
}

}  // namespace simsense
