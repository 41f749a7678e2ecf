/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KS_SYNC_H
#define KS_SYNC_H
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#ifdef __cplusplus
extern "C" {
#endif
#define KS_SYNC_HOST 0u
#define KS_SYNC_TIMELINE_FD 1u
#define KS_SYNC_TIMELINE 2u
#define KS_SYNC_SEMAPHORE 3u
#define KS_TYPE_SYNC 0x06u
typedef struct ks_sync {
  ks_header header;
  uint32_t kind;
  uint32_t reserved;
  uint64_t handle;
  uint64_t value;
} ks_sync;
static inline ks_sync ks_sync_init(void) {
  ks_sync s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KS_TYPE_SYNC, KS_CAST(uint32_t, sizeof s));
  return s;
}
#ifdef __cplusplus
}
#endif
#endif
