/* A strided view on a buffer: images, batches of images, point clouds. */
#ifndef KS_IMAGE_H
#define KS_IMAGE_H

#include <stdint.h>
#include <string.h>

#include "ks/header.h"

#define KS_FORMAT_U8 1u
#define KS_FORMAT_U16 2u
#define KS_FORMAT_I16 3u
#define KS_FORMAT_U32 4u
#define KS_FORMAT_F16 5u
#define KS_FORMAT_F32 6u

#define KS_MAX_DIMS 5

/* Element (i0, i1, ...) starts at offset_bytes + sum(i_k * byte_stride[k]). Strides may be 0 only where the extent is 1; they may be negative.
 * offset_bytes and the strides are multiples of the element's size. */
typedef struct ks_image_desc {
  ks_header header;
  uint32_t format;    /* KS_FORMAT_* */
  uint32_t dim_count; /* 1..KS_MAX_DIMS */
  uint64_t shape[KS_MAX_DIMS];
  int64_t byte_stride[KS_MAX_DIMS];
  uint64_t offset_bytes;
} ks_image_desc;

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

/* A densely packed view; the last dimension varies fastest. */
static inline ks_image_desc ks_image_desc_packed(uint32_t format, uint32_t dim_count, const uint64_t* shape) {
  ks_image_desc d;
  uint64_t stride = ks_format_bytes(format);
  uint32_t k;
  memset(&d, 0, sizeof d);
  d.header = ks_header_make(KS_TYPE_IMAGE_DESC, (uint32_t)sizeof d);
  d.format = format;
  d.dim_count = dim_count > KS_MAX_DIMS ? KS_MAX_DIMS : dim_count;
  for (k = d.dim_count; k-- > 0;) {
    d.shape[k] = shape[k];
    d.byte_stride[k] = (int64_t)stride;
    stride *= shape[k];
  }
  return d;
}

#endif
