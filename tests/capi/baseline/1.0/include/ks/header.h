/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KS_HEADER_H
#define KS_HEADER_H
#include <stdint.h>
#ifdef __cplusplus
#define KS_CAST(type, value) static_cast<type>(value)
#else
#define KS_CAST(type, value) ((type)(value))
#endif
typedef struct ks_header {
  uint32_t size_bytes;
  uint32_t type;
} ks_header;
static inline ks_header ks_header_make(uint32_t type, uint32_t size_bytes) {
  ks_header h;
  h.size_bytes = size_bytes;
  h.type = type;
  return h;
}
#endif
