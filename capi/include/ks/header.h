/* The first member of every extensible struct.
 * `size_bytes` is the sizeof the caller compiled with. A library copies min(size_bytes, known) into a zeroed struct of its own;
 * bytes it does not know must be zero, else KS_ERROR_VERSION. New fields are appended, and zero means "as before".
 * A struct that a call fills in is initialised by the caller too: size_bytes says how much of it may be written.
 * `type` is one of KS_TYPE_*; `next` chains optional structs and is NULL where none is used.
 * Each struct has an inline ks_..._init / kuafu_..._init / simsense_..._init that fills in the header and the defaults. */
#ifndef KS_HEADER_H
#define KS_HEADER_H

#include <stdint.h>

typedef struct ks_header {
  uint32_t type;
  uint32_t size_bytes;
  const struct ks_header* next;
} ks_header;

/* 0x01.. shared, 0x1000.. kuafu, 0x2000.. simsense. Values are never reused. */
#define KS_TYPE_DEVICE_DESC 0x01u
#define KS_TYPE_DEVICE_INFO 0x02u
#define KS_TYPE_BUFFER_CREATE 0x03u
#define KS_TYPE_BUFFER_DESC 0x04u
#define KS_TYPE_IMAGE_DESC 0x05u
#define KS_TYPE_SYNC 0x06u
#define KS_TYPE_EFFECT 0x07u
#define KS_TYPE_EFFECT_VIEW 0x08u
#define KS_TYPE_EFFECT_RANDOM_TERMS 0x09u

static inline ks_header ks_header_make(uint32_t type, uint32_t size_bytes) {
  ks_header h;
  h.type = type;
  h.size_bytes = size_bytes;
  h.next = 0;
  return h;
}

#endif
