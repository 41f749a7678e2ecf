/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SIMSENSE_COMPUTE_H
#define SIMSENSE_COMPUTE_H
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#include "ks/image.h"
#include "ks/log.h"
#include "ks/sync.h"
#ifdef __cplusplus
extern "C" {
#endif
typedef struct simsense_buffer_t* simsense_buffer;
#define SIMSENSE_OUTPUT_DISPARITY 1u
#define SIMSENSE_OUTPUT_DEPTH 2u
#define SIMSENSE_OUTPUT_DEPTH_RGB 3u
#define SIMSENSE_OUTPUT_IR_LEFT 4u
#define SIMSENSE_OUTPUT_IR_RIGHT 5u
#define SIMSENSE_OUTPUT_RECTIFIED_LEFT 6u
#define SIMSENSE_OUTPUT_RECTIFIED_RIGHT 7u
#define SIMSENSE_OUTPUT_POINTS 8u
#define SIMSENSE_OUTPUT_CONFIDENCE 9u
#define SIMSENSE_OUTPUT_REASON 10u
#define SIMSENSE_OUTPUT_POINTS_COLORED 11u
#define SIMSENSE_REASON_VALID 0u
#define SIMSENSE_REASON_NOT_UNIQUE 1u
#define SIMSENSE_REASON_OUTSIDE 2u
#define SIMSENSE_REASON_OCCLUDED 3u
#define SIMSENSE_REASON_ISOLATED 4u
#define SIMSENSE_REASON_SPECKLE 5u
#define SIMSENSE_REASON_OUT_OF_RANGE 6u
#define SIMSENSE_REASON_NOT_COMPUTED 7u
#define SIMSENSE_REASON_LOW_TEXTURE 8u
#define SIMSENSE_REASON_SATURATED 9u
#define SIMSENSE_TYPE_OUTPUT_DESC 0x2004u
#define SIMSENSE_TYPE_COMPUTE_DESC 0x2003u
typedef struct simsense_image {
  simsense_buffer buffer;
  void* host;
  ks_image_desc image;
} simsense_image;
typedef struct simsense_output_desc {
  ks_header header;
  uint32_t output;
  uint32_t reserved;
  simsense_image image;
} simsense_output_desc;
static inline simsense_output_desc simsense_output_desc_init(uint32_t output, simsense_image image) {
  simsense_output_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(SIMSENSE_TYPE_OUTPUT_DESC, KS_CAST(uint32_t, sizeof s));
  s.output = output;
  s.image = image;
  return s;
}
typedef struct simsense_compute_desc {
  ks_header header;
  simsense_image left;
  simsense_image right;
  simsense_image left_laser;
  simsense_image right_laser;
  simsense_image rgb;
  const simsense_output_desc* outputs;
  uint32_t output_count;
  uint32_t reserved;
  ks_progress_fn progress;
  void* progress_user;
  const ks_sync* wait;
  const uint64_t* noise_seeds;
} simsense_compute_desc;
static inline simsense_compute_desc simsense_compute_desc_init(void) {
  simsense_compute_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(SIMSENSE_TYPE_COMPUTE_DESC, KS_CAST(uint32_t, sizeof s));
  return s;
}
#ifdef __cplusplus
}
#endif
#endif
