/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SIMSENSE_PARAMETERS_H
#define SIMSENSE_PARAMETERS_H
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#ifdef __cplusplus
extern "C" {
#endif
#define SIMSENSE_TYPE_PARAMETERS 0x2002u
#define SIMSENSE_CENSUS_CENTER_SYMMETRIC 0u
#define SIMSENSE_CENSUS_PLAIN 1u
#define SIMSENSE_SUBPIXEL_NONE 0u
#define SIMSENSE_SUBPIXEL_PARABOLA 1u
#define SIMSENSE_SUBPIXEL_EQUIANGULAR 2u
#define SIMSENSE_SUBPIXEL_EQUIANGULAR_SUMMED 3u
#define SIMSENSE_HOLES_KEEP 0u
#define SIMSENSE_HOLES_LEFT 1u
#define SIMSENSE_HOLES_BACKGROUND 2u
typedef struct simsense_parameters {
  ks_header header;
  uint64_t noise_seed;
  uint64_t frame_index;
  uint32_t roi_x;
  uint32_t roi_y;
  uint32_t roi_width;
  uint32_t roi_height;
  uint32_t census_width;
  uint32_t census_height;
  uint32_t census_kind;
  float census_contrast;
  uint32_t census_noise_dn;
  int32_t min_disparity;
  uint32_t max_disparity;
  uint32_t block_width;
  uint32_t block_height;
  uint32_t p1;
  uint32_t p2;
  uint32_t p2_full_gradient_dn;
  uint32_t path_count;
  uint32_t subpixel;
  uint32_t uniqueness_ratio;
  int32_t lr_max_diff;
  uint32_t median_size;
  uint32_t speckle_max_size;
  float speckle_max_diff_px;
  uint32_t min_texture_dn;
  float edge_step_px;
  uint32_t right_border_px;
  uint32_t low_texture_dn;
  uint32_t hole_filling;
  float min_depth_m;
  float max_depth_m;
  uint32_t depth_dilation;
  uint32_t splat_size;
} simsense_parameters;
static inline simsense_parameters simsense_parameters_init(void) {
  simsense_parameters s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(SIMSENSE_TYPE_PARAMETERS, KS_CAST(uint32_t, sizeof s));
  s.census_width = 7u;
  s.census_height = 7u;
  s.census_contrast = 0.0625f;
  s.max_disparity = 128u;
  s.block_width = 7u;
  s.block_height = 7u;
  s.p1 = 8u;
  s.p2 = 32u;
  s.path_count = 4u;
  s.subpixel = SIMSENSE_SUBPIXEL_EQUIANGULAR;
  s.uniqueness_ratio = 15u;
  s.lr_max_diff = 1;
  s.median_size = 3u;
  s.speckle_max_diff_px = 1.0f;
  s.low_texture_dn = 4u;
  s.max_depth_m = 10.0f;
  s.splat_size = 1u;
  return s;
}
#ifdef __cplusplus
}
#endif
#endif
