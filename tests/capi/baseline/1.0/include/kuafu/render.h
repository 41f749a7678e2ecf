/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KUAFU_RENDER_H
#define KUAFU_RENDER_H
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#include "ks/log.h"
#include "ks/sync.h"
#include "kuafu/camera.h"
#include "kuafu/material.h"
#include "kuafu/optics.h"
#include "kuafu/output.h"
#ifdef __cplusplus
extern "C" {
#endif
#define KUAFU_TYPE_RENDERER_DESC 0x100cu
#define KUAFU_TRACER_AUTO 0u
#define KUAFU_TRACER_EMBREE 1u
#define KUAFU_TRACER_COMPUTE 2u
#define KUAFU_TRACER_RT_PIPELINE 3u
#define KUAFU_TYPE_VIEW_DESC 0x1008u
#define KUAFU_BAND_VISIBLE 0u
#define KUAFU_BAND_INFRARED 1u
#define KUAFU_TYPE_RENDER_DESC 0x100au
#define KUAFU_SAMPLING_MIS 0u
#define KUAFU_SAMPLING_LIGHTS 1u
#define KUAFU_SAMPLING_BSDF 2u
#define KUAFU_DENOISE_NONE 0u
#define KUAFU_DENOISE_ATROUS 1u
#define KUAFU_DENOISE_OIDN 2u
#define KUAFU_GLASS_SHADOWS_STRAIGHT 0u
#define KUAFU_GLASS_SHADOWS_BENT 1u
#define KUAFU_TYPE_RENDER_SUMMARY 0x100eu
typedef struct kuafu_renderer_desc {
  ks_header header;
  uint32_t tracer;
  uint32_t reserved;
  const char* oidn_library;
} kuafu_renderer_desc;
static inline kuafu_renderer_desc kuafu_renderer_desc_init(void) {
  kuafu_renderer_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KUAFU_TYPE_RENDERER_DESC, KS_CAST(uint32_t, sizeof s));
  return s;
}
typedef struct kuafu_view_desc {
  ks_header header;
  kuafu_camera_desc camera;
  uint32_t band;
  uint32_t environment;
  const kuafu_optics_desc* optics;
  double previous_camera_to_world[16];
} kuafu_view_desc;
static inline kuafu_view_desc kuafu_view_desc_init(void) {
  kuafu_view_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KUAFU_TYPE_VIEW_DESC, KS_CAST(uint32_t, sizeof s));
  s.camera = kuafu_camera_desc_init();
  return s;
}
typedef struct kuafu_render_desc {
  ks_header header;
  const kuafu_view_desc* views;
  const kuafu_output_desc* outputs;
  uint32_t view_count;
  uint32_t output_count;
  uint32_t samples_per_pixel;
  uint32_t max_bounces;
  uint64_t seed;
  uint32_t first_sample;
  float ir_ambient_scale;
  float ir_ambient_radiance;
  uint32_t glass_surfaces;
  ks_progress_fn progress;
  void* progress_user;
  uint32_t light_sampling;
  uint32_t denoise;
  uint32_t projector;
  float temporal_weight;
  uint32_t accumulate;
  uint32_t glass_shadows;
  double max_seconds;
  double relative_error;
  const ks_sync* wait;
} kuafu_render_desc;
static inline kuafu_render_desc kuafu_render_desc_init(void) {
  kuafu_render_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KUAFU_TYPE_RENDER_DESC, KS_CAST(uint32_t, sizeof s));
  s.samples_per_pixel = 16u;
  s.max_bounces = 8u;
  s.ir_ambient_scale = 0.05f;
  s.ir_ambient_radiance = 0.002f;
  s.glass_surfaces = 8u;
  return s;
}
typedef struct kuafu_render_summary {
  ks_header header;
  uint32_t samples_per_pixel;
  uint32_t call_samples_per_pixel;
  double relative_error;
  double seconds;
} kuafu_render_summary;
static inline kuafu_render_summary kuafu_render_summary_init(void) {
  kuafu_render_summary s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KUAFU_TYPE_RENDER_SUMMARY, KS_CAST(uint32_t, sizeof s));
  return s;
}
#ifdef __cplusplus
}
#endif
#endif
