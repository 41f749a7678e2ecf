/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KUAFU_LIGHT_H
#define KUAFU_LIGHT_H
#include <math.h>
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#include "ks/lens.h"
#ifdef __cplusplus
extern "C" {
#endif
#define KUAFU_ALL_ENVIRONMENTS 0xffffffffu
#define KUAFU_TYPE_LIGHT_DESC 0x1005u
#define KUAFU_LIGHT_POINT 1u
#define KUAFU_LIGHT_PROJECTOR 2u
#define KUAFU_LIGHT_DIRECTIONAL 3u
#define KUAFU_LIGHT_SPOT 4u
#define KUAFU_LIGHT_RECTANGLE 5u
#define KUAFU_LIGHT_DISK 6u
#define KUAFU_TYPE_ENVIRONMENT_DESC 0x1007u
typedef struct kuafu_light_desc {
  ks_header header;
  const char* name;
  uint32_t kind;
  uint32_t environment;
  float intensity[3];
  float ir_intensity;
  uint32_t texture;
  uint32_t light_group;
  double light_to_world[16];
  double linear_velocity[3];
  double angular_velocity[3];
  double on_from_s;
  double on_until_s;
  double radius_m;
  double size_m[2];
  double angle_rad;
  double inner_rad;
  double outer_rad;
  double range_m;
  double k[9];
  ks_lens lens;
  double falloff;
  double focus_m;
  double pattern_scale;
  const float* dots;
  uint32_t dot_count;
  uint32_t pattern_width;
  uint32_t pattern_height;
  float dot_sigma_px;
  double dot_background;
} kuafu_light_desc;
static inline kuafu_light_desc kuafu_light_desc_init(uint32_t kind) {
  kuafu_light_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KUAFU_TYPE_LIGHT_DESC, KS_CAST(uint32_t, sizeof s));
  s.kind = kind;
  s.environment = KUAFU_ALL_ENVIRONMENTS;
  s.ir_intensity = NAN;
  s.light_to_world[0] = 1.0;
  s.light_to_world[5] = 1.0;
  s.light_to_world[10] = 1.0;
  s.light_to_world[15] = 1.0;
  s.outer_rad = 0.7853981633974483;
  s.k[0] = 1.0;
  s.k[4] = 1.0;
  s.k[8] = 1.0;
  s.pattern_scale = 1.0;
  return s;
}
typedef struct kuafu_environment_desc {
  ks_header header;
  float radiance[3];
  float ir_radiance;
  uint32_t texture;
  uint32_t light_group;
  double map_to_world[9];
} kuafu_environment_desc;
static inline kuafu_environment_desc kuafu_environment_desc_init(void) {
  kuafu_environment_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KUAFU_TYPE_ENVIRONMENT_DESC, KS_CAST(uint32_t, sizeof s));
  s.ir_radiance = NAN;
  s.map_to_world[0] = 1.0;
  s.map_to_world[4] = 1.0;
  s.map_to_world[8] = 1.0;
  return s;
}
#ifdef __cplusplus
}
#endif
#endif
