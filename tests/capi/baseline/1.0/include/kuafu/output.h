/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KUAFU_OUTPUT_H
#define KUAFU_OUTPUT_H
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#include "ks/image.h"
#ifdef __cplusplus
extern "C" {
#endif
typedef struct kuafu_buffer_t* kuafu_buffer;
#define KUAFU_OUTPUT_RADIANCE 1u
#define KUAFU_OUTPUT_PROJECTOR_DIRECT 2u
#define KUAFU_OUTPUT_PROJECTOR_INDIRECT 3u
#define KUAFU_OUTPUT_AMBIENT 4u
#define KUAFU_OUTPUT_LIGHT_GROUP_0 5u
#define KUAFU_OUTPUT_VARIANCE 9u
#define KUAFU_OUTPUT_SAMPLE_COUNT 10u
#define KUAFU_OUTPUT_PROJECTOR 11u
#define KUAFU_OUTPUT_SRGB 12u
#define KUAFU_OUTPUT_DEPTH 16u
#define KUAFU_OUTPUT_NORMAL 17u
#define KUAFU_NOTHING_HIT 0xffffffffu
#define KUAFU_OUTPUT_INSTANCE_ID 18u
#define KUAFU_OUTPUT_MATERIAL_ID 19u
#define KUAFU_OUTPUT_SEMANTIC_ID 20u
#define KUAFU_OUTPUT_POSITION 21u
#define KUAFU_OUTPUT_ALBEDO 22u
#define KUAFU_OUTPUT_ROUGHNESS 23u
#define KUAFU_OUTPUT_TRANSMISSION 24u
#define KUAFU_OUTPUT_PROJECTOR_UV 25u
#define KUAFU_OUTPUT_PROJECTOR_VISIBILITY 26u
#define KUAFU_OUTPUT_PROJECTOR_GEOMETRY 27u
#define KUAFU_OUTPUT_MOTION 28u
#define KUAFU_TYPE_OUTPUT_DESC 0x1009u
typedef struct kuafu_output_desc {
  ks_header header;
  uint32_t output;
  float scale;
  kuafu_buffer buffer;
  ks_image_desc image;
} kuafu_output_desc;
static inline kuafu_output_desc kuafu_output_desc_init(uint32_t output, kuafu_buffer buffer, ks_image_desc image) {
  kuafu_output_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KUAFU_TYPE_OUTPUT_DESC, KS_CAST(uint32_t, sizeof s));
  s.output = output;
  s.buffer = buffer;
  s.image = image;
  return s;
}
#ifdef __cplusplus
}
#endif
#endif
