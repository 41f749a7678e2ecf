/* SPDX-License-Identifier: Apache-2.0 */
/* The first member of every extensible struct.
 * `size_bytes` is the sizeof that the caller compiled with. A library copies min(size_bytes, known) into a struct of its own; bytes that it does not
 * know must be zero, else KS_ERROR_VERSION. Fields are only ever appended. One that the caller's struct does not have yet takes its neutral value
 * (capi/generation/reference.md): what the library did before there was the field; for every field that is appended after version 0.1 this is 0.
 * A struct that a call fills in is initialised by the caller too: size_bytes says how much of it may be written. Fields named reserved must be 0.
 * `type` is one of ..._TYPE_...; `next` chains optional structs and is NULL where none is used.
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
  uint32_t type;
  uint32_t size_bytes;
  const struct ks_header* next;
} ks_header;

/* Types stand beside their structs: 0x01.. shared, 0x1000.. kuafu, 0x2000.. simsense. Values are never reused. */

static inline ks_header ks_header_make(uint32_t type, uint32_t size_bytes) {
  ks_header h;
  h.type = type;
  h.size_bytes = size_bytes;
  h.next = 0;
  return h;
}

#endif
