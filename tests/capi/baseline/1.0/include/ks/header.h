/* SPDX-License-Identifier: Apache-2.0 */
/* The first member of every extensible struct.
 * `size_bytes` is the sizeof that the caller compiled with. A library reads min(size_bytes, its own sizeof): fields that the caller's struct does not have
 * are 0, and bytes that the library does not know must be 0, else KS_ERROR_VERSION. Fields are only ever appended, and 0 in one that came after version 1.0
 * means what the library did before. A struct that a call fills in is initialised by the caller too: size_bytes says how much of it may be written.
 * Fields named reserved must be 0. `type` is one of ..._TYPE_...
 * Each struct has an inline ks_..._init / kuafu_..._init / simsense_..._init that fills in the header and the defaults; for languages that read no
 * headers kuafu_struct_init and simsense_struct_init do the same. */
#ifndef KS_HEADER_H
#define KS_HEADER_H

#include <stdint.h>

/* For hosts that compile these headers as C++ and are warned of C's casts. */
#ifdef __cplusplus
#define KS_CAST(type, value) static_cast<type>(value)
#else
#define KS_CAST(type, value) ((type)(value))
#endif

typedef struct ks_header {
  uint32_t size_bytes; /* of the caller's struct */
  uint32_t type;       /* ..._TYPE_... */
} ks_header;

/* Types stand beside their structs: 0x01.. shared, 0x1000.. kuafu, 0x2000.. simsense. Values are never reused. */

static inline ks_header ks_header_make(uint32_t type, uint32_t size_bytes) {
  ks_header h;
  h.size_bytes = size_bytes;
  h.type = type;
  return h;
}

#endif
