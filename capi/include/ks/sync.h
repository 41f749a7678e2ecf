/* When shared memory may be read. KS_SYNC_HOST is the mandatory kind: the call has finished on the host before it returns, so nothing is left to wait for.
 * Semaphores are a capability (ks_device_info.capabilities) that lavapipe does not have. */
#ifndef KS_SYNC_H
#define KS_SYNC_H

#include <stdint.h>
#include <string.h>

#include "ks/header.h"

#define KS_SYNC_HOST 0u
#define KS_SYNC_TIMELINE_FD 1u /* an opaque fd of a timeline semaphore, which reaches `value` */
#define KS_SYNC_TIMELINE 2u    /* the maker's own timeline: its ..._wait takes this */

typedef struct ks_sync {
  ks_header header;
  uint32_t kind;     /* KS_SYNC_* */
  uint32_t reserved;
  uint64_t handle;   /* fd, for KS_SYNC_TIMELINE_FD: the caller's to close */
  uint64_t value;
} ks_sync;

static inline ks_sync ks_sync_init(void) {
  ks_sync s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KS_TYPE_SYNC, (uint32_t)sizeof s);
  return s;
}

#endif
