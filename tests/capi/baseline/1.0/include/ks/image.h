/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KS_IMAGE_H
#define KS_IMAGE_H
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#ifdef __cplusplus
extern "C" {
#endif
#define KS_FORMAT_U8 1u
#define KS_FORMAT_U16 2u
#define KS_FORMAT_I16 3u
#define KS_FORMAT_U32 4u
#define KS_FORMAT_F16 5u
#define KS_FORMAT_F32 6u
#define KS_MAX_DIMS 5
static inline uint32_t ks_format_bytes(uint32_t format) {
  switch (format) {
    case KS_FORMAT_U8: return 1;
    case KS_FORMAT_U16:
    case KS_FORMAT_I16:
    case KS_FORMAT_F16: return 2;
    case KS_FORMAT_U32:
    case KS_FORMAT_F32: return 4;
    default: return 0;
  }
}
#define KS_TYPE_IMAGE_DESC 0x05u
typedef struct ks_image_desc {
  ks_header header;
  uint32_t format;
  uint32_t dim_count;
  uint64_t shape[KS_MAX_DIMS];
  int64_t byte_stride[KS_MAX_DIMS];
  uint64_t offset_bytes;
} ks_image_desc;
static inline ks_image_desc ks_image_desc_init(void) {
  ks_image_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KS_TYPE_IMAGE_DESC, KS_CAST(uint32_t, sizeof s));
  return s;
}
static inline ks_image_desc ks_image_desc_packed(uint32_t format, uint32_t dim_count, const uint64_t* shape) {
  ks_image_desc d;
  uint64_t stride = ks_format_bytes(format);
  uint32_t k;
  memset(&d, 0, sizeof d);
  d.header = ks_header_make(KS_TYPE_IMAGE_DESC, KS_CAST(uint32_t, sizeof d));
  d.format = format;
  d.dim_count = dim_count > KS_MAX_DIMS ? KS_MAX_DIMS : dim_count;
  for (k = d.dim_count; k-- > 0;) {
    d.shape[k] = shape[k];
    d.byte_stride[k] = KS_CAST(int64_t, stride);
    stride *= shape[k];
  }
  return d;
}
#ifdef __cplusplus
}
#endif
#endif
