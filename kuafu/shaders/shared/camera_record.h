// SPDX-License-Identifier: Apache-2.0
// What a camera has beyond a pinhole at rest (ViewRecord), read by GLSL and C++ (scalar layout); read only with feature_camera.
#ifndef KUAFU_CAMERA_RECORD_H
#define KUAFU_CAMERA_RECORD_H

#include "shared/lens_record.h"
#include "shared/motion_record.h"

#ifdef __cplusplus
namespace kuafu {
#endif

KUAFU_CONST camera_distorts = 1u;
KUAFU_CONST camera_has_lens = 2u;
KUAFU_CONST camera_moves = 4u;

struct CameraRecord {
  vec3 axis_x, axis_y, axis_z;  // world directions of the camera's axes at t = 0
  MotionRecord motion;
  vec2 focal, centre;  // of K, pixels
  float skew;
  LensRecord lens;
  float lens_radius_m;
  float inverse_focus;      // 1/m; 0: focused at infinity
  vec2 seconds_per_pixel;   // rolling shutter: along columns and rows
  float exposure_s;
  uint flags;  // camera_*
};
KUAFU_ARRAY(CameraArray, CameraRecord, 4)

#ifdef __cplusplus
static_assert(sizeof(CameraRecord) == 156);
}  // namespace kuafu
#endif
#endif
