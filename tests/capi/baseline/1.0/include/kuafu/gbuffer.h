/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KUAFU_GBUFFER_H
#define KUAFU_GBUFFER_H
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#include "kuafu/render.h"
#ifdef __cplusplus
extern "C" {
#endif
#define KUAFU_TYPE_GBUFFER 0x1011u
#define KUAFU_TYPE_GBUFFER_DESC 0x1012u
#define KUAFU_GBUFFER_DEPTH_PLANAR 0u
#define KUAFU_GBUFFER_DEPTH_RAY 1u
typedef struct kuafu_gbuffer {
  ks_header header;
  kuafu_buffer depth;
  kuafu_buffer normal;
  kuafu_buffer albedo;
  kuafu_buffer material;
} kuafu_gbuffer;
static inline kuafu_gbuffer kuafu_gbuffer_init(void) {
  kuafu_gbuffer s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KUAFU_TYPE_GBUFFER, KS_CAST(uint32_t, sizeof s));
  return s;
}
typedef struct kuafu_gbuffer_desc {
  ks_header header;
  const kuafu_view_desc* left_view;
  const kuafu_view_desc* right_view;
  const kuafu_gbuffer* left;
  const kuafu_gbuffer* right;
  kuafu_buffer projector_depth;
  const float* laser_power;
  const float* ambient_radiance;
  const kuafu_output_desc* outputs;
  uint32_t output_count;
  uint32_t environment_count;
  uint32_t depth_kind;
  uint32_t reserved;
} kuafu_gbuffer_desc;
static inline kuafu_gbuffer_desc kuafu_gbuffer_desc_init(void) {
  kuafu_gbuffer_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KUAFU_TYPE_GBUFFER_DESC, KS_CAST(uint32_t, sizeof s));
  return s;
}
#ifdef __cplusplus
}
#endif
#endif
