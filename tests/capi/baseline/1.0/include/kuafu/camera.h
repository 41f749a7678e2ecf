/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KUAFU_CAMERA_H
#define KUAFU_CAMERA_H
#include <math.h>
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#include "ks/lens.h"
#ifdef __cplusplus
extern "C" {
#endif
#define KUAFU_TYPE_CAMERA_DESC 0x1006u
#define KUAFU_SHUTTER_GLOBAL 0u
#define KUAFU_SHUTTER_ROLLING 1u
#define KUAFU_READOUT_ROWS_DOWN 0u
#define KUAFU_READOUT_ROWS_UP 1u
#define KUAFU_READOUT_COLUMNS_RIGHT 2u
#define KUAFU_READOUT_COLUMNS_LEFT 3u
typedef struct kuafu_camera_desc {
  ks_header header;
  uint32_t width;
  uint32_t height;
  double k[9];
  double camera_to_world[16];
  double near_m;
  double far_m;
  ks_lens lens;
  double lens_radius_m;
  double focus_m;
  uint32_t shutter;
  uint32_t readout;
  double exposure_s;
  double line_time_s;
  double linear_velocity[3];
  double angular_velocity[3];
} kuafu_camera_desc;
static inline kuafu_camera_desc kuafu_camera_desc_init(void) {
  kuafu_camera_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KUAFU_TYPE_CAMERA_DESC, KS_CAST(uint32_t, sizeof s));
  s.k[0] = 1.0;
  s.k[4] = 1.0;
  s.k[8] = 1.0;
  s.camera_to_world[0] = 1.0;
  s.camera_to_world[5] = 1.0;
  s.camera_to_world[10] = 1.0;
  s.camera_to_world[15] = 1.0;
  s.far_m = INFINITY;
  return s;
}
#ifdef __cplusplus
}
#endif
#endif
