/* Memory that two libraries share. A handle of one library never crosses to the other: one exports a plain ks_buffer_desc, the other imports it.
 *
 * File descriptors: a library never closes an fd you gave it, and never closes one it gave you (import duplicates, each export returns a fresh fd).
 * KS_MEMORY_OPAQUE_FD is valid only between Vulkan devices of equal device and driver UUID; the descriptor carries both and import checks them.
 * KS_MEMORY_HOST is a pointer of this process; the importer must be released before the exporter's buffer is. */
#ifndef KS_BUFFER_H
#define KS_BUFFER_H

#include <stdint.h>
#include <string.h>

#include "ks/header.h"

#define KS_MEMORY_HOST 1u
#define KS_MEMORY_OPAQUE_FD 2u

/* Bits of ks_buffer_create.flags. */
#define KS_BUFFER_EXPORTABLE 0x1u   /* may be exported as KS_MEMORY_OPAQUE_FD */
#define KS_BUFFER_HOST_VISIBLE 0x2u /* may be mapped, and exported as KS_MEMORY_HOST */

typedef struct ks_buffer_create {
  ks_header header;
  uint64_t size_bytes; /* > 0 */
  uint32_t flags;      /* KS_BUFFER_* */
  uint32_t reserved;
} ks_buffer_create;

static inline ks_buffer_create ks_buffer_create_init(uint64_t size_bytes, uint32_t flags) {
  ks_buffer_create c;
  memset(&c, 0, sizeof c);
  c.header = ks_header_make(KS_TYPE_BUFFER_CREATE, (uint32_t)sizeof c);
  c.size_bytes = size_bytes;
  c.flags = flags;
  return c;
}

typedef struct ks_buffer_desc {
  ks_header header;
  uint32_t memory;            /* KS_MEMORY_* */
  uint32_t memory_type_index; /* Vulkan's, for OPAQUE_FD */
  uint64_t handle;            /* pointer value or fd */
  uint64_t allocation_bytes;  /* size of the exporter's whole allocation */
  uint64_t offset_bytes;      /* where the buffer starts in it */
  uint64_t size_bytes;
  uint32_t dedicated;         /* nonzero: a Vulkan dedicated allocation */
  uint32_t reserved;
  uint8_t device_uuid[16];
  uint8_t driver_uuid[16];
} ks_buffer_desc;

static inline ks_buffer_desc ks_buffer_desc_init(void) {
  ks_buffer_desc b;
  memset(&b, 0, sizeof b);
  b.header = ks_header_make(KS_TYPE_BUFFER_DESC, (uint32_t)sizeof b);
  return b;
}

#endif
