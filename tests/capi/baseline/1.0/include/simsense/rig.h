/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SIMSENSE_RIG_H
#define SIMSENSE_RIG_H
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#include "ks/lens.h"
#ifdef __cplusplus
extern "C" {
#endif
#define SIMSENSE_FAULTS_PUBLISHED 0x7fu
#define SIMSENSE_TYPE_RIG_DESC 0x2001u
#define SIMSENSE_FAULT_RECTIFIED_SHRUNK 0x01u
#define SIMSENSE_FAULT_FOCAL_FROM_RECTIFIER 0x02u
#define SIMSENSE_FAULT_REMAP_NEAREST 0x04u
#define SIMSENSE_FAULT_PADDING_MATCHED 0x08u
#define SIMSENSE_FAULT_REGISTRATION_UNRECTIFIED 0x10u
#define SIMSENSE_FAULT_SPLAT_INVALID 0x20u
#define SIMSENSE_FAULT_SPLAT_CLIPPED 0x40u
#define SIMSENSE_BACK_END_AUTO 0u
#define SIMSENSE_BACK_END_CPU 1u
#define SIMSENSE_BACK_END_VULKAN 2u
typedef struct simsense_camera {
  uint32_t width;
  uint32_t height;
  double k[9];
  ks_lens lens;
} simsense_camera;
typedef struct simsense_rig_desc {
  ks_header header;
  simsense_camera left;
  simsense_camera right;
  simsense_camera rgb;
  double left_to_right[16];
  double left_to_rgb[16];
  uint32_t rectified;
  uint32_t batch_count;
  uint32_t faults;
  uint32_t back_end;
  uint32_t low_memory;
  uint32_t reserved;
} simsense_rig_desc;
static inline simsense_rig_desc simsense_rig_desc_init(void) {
  simsense_rig_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(SIMSENSE_TYPE_RIG_DESC, KS_CAST(uint32_t, sizeof s));
  s.left_to_right[0] = 1.0;
  s.left_to_right[5] = 1.0;
  s.left_to_right[10] = 1.0;
  s.left_to_right[15] = 1.0;
  s.left_to_rgb[0] = 1.0;
  s.left_to_rgb[5] = 1.0;
  s.left_to_rgb[10] = 1.0;
  s.left_to_rgb[15] = 1.0;
  s.batch_count = 1u;
  return s;
}
#ifdef __cplusplus
}
#endif
#endif
