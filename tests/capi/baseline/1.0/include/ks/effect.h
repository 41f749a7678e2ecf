/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KS_EFFECT_H
#define KS_EFFECT_H
#include <math.h>
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#include "ks/status.h"
#ifdef __cplusplus
extern "C" {
#endif
#define KS_STAGE_PROJECTOR 1u
#define KS_STAGE_MEDIUM 2u
#define KS_STAGE_SURFACE 3u
#define KS_STAGE_CAMERA 4u
#define KS_STAGE_OPTICS 5u
#define KS_STAGE_CHARGE 6u
#define KS_STAGE_READOUT 7u
#define KS_STAGE_DIGITAL 8u
#define KS_STAGE_DISPARITY 9u
#define KS_STAGE_DEPTH 10u
struct ks_effect_view;
typedef int32_t (*ks_effect_apply_fn)(const struct ks_effect_view* view, const double* parameters, uint32_t image_count, const double* images,
                                      double* out);
#define KS_LEVER_ONE 0u
#define KS_LEVER_SIGNAL 1u
#define KS_LEVER_PROJECTOR 2u
#define KS_LEVER_EXPOSURE 3u
#define KS_LEVER_PHOTONS 4u
#define KS_SHARED_BY_PIXEL 0u
#define KS_SHARED_BY_VIEW 1u
#define KS_SHARED_BY_COLUMN 2u
#define KS_SHARED_BY_ROW 3u
#define KS_SHARED_BY_DOT 4u
#define KS_TYPE_EFFECT_VIEW 0x08u
#define KS_TYPE_EFFECT 0x07u
#define KS_RANDOMNESS_NONE 0u
#define KS_RANDOMNESS_STATIC 1u
#define KS_RANDOMNESS_TEMPORAL 2u
typedef struct ks_effect_random_term {
  const char* parameter;
  const char* sparse_share;
  uint32_t lever;
  uint32_t shared_by;
} ks_effect_random_term;
typedef struct ks_effect_parameter {
  const char* name;
  const char* unit;
  const char* source;
  double neutral;
  double low;
  double high;
  double typical;
} ks_effect_parameter;
typedef struct ks_effect_view {
  ks_header header;
  uint32_t width;
  uint32_t height;
  uint32_t is_right;
  uint32_t frame_id;
  double k[9];
  double projector_k[9];
  double camera_to_projector[16];
  double left_to_camera[16];
  double camera_velocity[6];
  double baseline_m;
  double max_dn;
  double exposure_s;
  double gain;
  double timestamp_s;
  double temperature_c;
  uint64_t random_seed;
  const double* depth_m;
  const double* normal;
  const float* pattern;
  uint32_t pattern_width;
  uint32_t pattern_height;
} ks_effect_view;
static inline ks_effect_view ks_effect_view_init(void) {
  ks_effect_view s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KS_TYPE_EFFECT_VIEW, KS_CAST(uint32_t, sizeof s));
  s.temperature_c = NAN;
  return s;
}
typedef struct ks_effect {
  ks_header header;
  const char* id;
  const char* family;
  const char* summary;
  const char* source;
  uint32_t stage;
  uint32_t randomness;
  uint32_t parameter_count;
  uint32_t random_term_count;
  const ks_effect_parameter* parameters;
  ks_effect_apply_fn apply;
  const ks_effect_random_term* random_terms;
} ks_effect;
static inline ks_effect ks_effect_init(void) {
  ks_effect s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KS_TYPE_EFFECT, KS_CAST(uint32_t, sizeof s));
  return s;
}
#define KS_EFFECT_PLUGIN_NAME "ks_effect_plugin"
typedef const ks_effect* (*ks_effect_plugin_fn)(uint32_t* count);
#ifdef __cplusplus
}
#endif
#endif
