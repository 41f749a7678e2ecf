// SPDX-License-Identifier: Apache-2.0
// What `aov` reads beyond the scene: projectors and motion, filled where an output asks for them. Read by GLSL and C++ (scalar layout).
#ifndef KUAFU_AOV_RECORD_H
#define KUAFU_AOV_RECORD_H

#include "shared/scene_records.h"

#ifdef __cplusplus
namespace kuafu {
#endif

/// The projector whose AOVs an environment's views get.
struct ProjectorRecord {
  LightRecord light;
  LightShape shape;
  uint found, reserved;  // found: nonzero when there is one
};
KUAFU_ARRAY(ProjectorArray, ProjectorRecord, 8)

struct CameraPose {
  vec3 origin, axis_x, axis_y, axis_z;  // world
};

/// A camera now and one frame before.
struct MotionView {
  CameraPose now, previous;
  vec2 focal, centre;  // of K, pixels
  float skew;
  LensRecord lens;
};
KUAFU_ARRAY(MotionViewArray, MotionView, 4)

struct AovAddresses {
  ProjectorArray projectors;           // by environment
  MotionViewArray motion;              // by view
  Vec4Array previous_local_to_world;   // rows, three of each instance slot, one frame before
};
KUAFU_ARRAY(AovReference, AovAddresses, 8)

#ifdef __cplusplus
static_assert(sizeof(ProjectorRecord) == sizeof(LightRecord) + sizeof(LightShape) + 8);
static_assert(sizeof(MotionView) == 152);
static_assert(sizeof(AovAddresses) == 24);
}  // namespace kuafu
#endif
#endif
