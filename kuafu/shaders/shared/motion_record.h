// SPDX-License-Identifier: Apache-2.0
// Rigid motion at constant velocity, read by GLSL and C++ (scalar layout): src/scene/motion.h in float.
#ifndef KUAFU_MOTION_RECORD_H
#define KUAFU_MOTION_RECORD_H

#include "shared/arrays.h"
#include "shared/ray_queue.h"

#ifdef __cplusplus
namespace kuafu {
#endif

/// x goes to pivot + R(angular t) (x - pivot) + path(t); path starts with `linear`, which turns with the object.
struct MotionRecord {
  vec3 pivot;    // metres, world
  vec3 linear;   // m/s
  vec3 angular;  // rad/s
  uint moves;    // 0: stands still
};
KUAFU_ARRAY(MotionArray, MotionRecord, 4)

#ifdef __cplusplus
static_assert(sizeof(MotionRecord) == 40);
}  // namespace kuafu
#endif
#endif
