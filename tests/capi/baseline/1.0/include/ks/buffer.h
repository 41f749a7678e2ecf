/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KS_BUFFER_H
#define KS_BUFFER_H
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#ifdef __cplusplus
extern "C" {
#endif
#define KS_MEMORY_HOST 1u
#define KS_MEMORY_OPAQUE_FD 2u
#define KS_MEMORY_VULKAN 3u
#define KS_MEMORY_DMA_BUF 4u
#define KS_BUFFER_EXPORTABLE 0x1u
#define KS_BUFFER_HOST_VISIBLE 0x2u
#define KS_BUFFER_DMA_BUF 0x4u
#define KS_TYPE_BUFFER_CREATE 0x03u
#define KS_TYPE_BUFFER_DESC 0x04u
typedef struct ks_buffer_create {
  ks_header header;
  uint64_t size_bytes;
  uint32_t flags;
  uint32_t reserved;
} ks_buffer_create;
static inline ks_buffer_create ks_buffer_create_init(uint64_t size_bytes, uint32_t flags) {
  ks_buffer_create s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KS_TYPE_BUFFER_CREATE, KS_CAST(uint32_t, sizeof s));
  s.size_bytes = size_bytes;
  s.flags = flags;
  return s;
}
typedef struct ks_buffer_desc {
  ks_header header;
  uint32_t memory;
  uint32_t memory_type_index;
  uint64_t handle;
  uint64_t allocation_bytes;
  uint64_t offset_bytes;
  uint64_t size_bytes;
  uint32_t dedicated;
  uint32_t reserved;
  uint8_t device_uuid[16];
  uint8_t driver_uuid[16];
} ks_buffer_desc;
static inline ks_buffer_desc ks_buffer_desc_init(void) {
  ks_buffer_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KS_TYPE_BUFFER_DESC, KS_CAST(uint32_t, sizeof s));
  return s;
}
#ifdef __cplusplus
}
#endif
#endif
