/* Callbacks from a library to its host. A library never prints; what it has to say goes through these.
 * They must not throw and must not call back into the library. */
#ifndef KS_LOG_H
#define KS_LOG_H

#include <stdint.h>

#define KS_LOG_INFO 0u
#define KS_LOG_WARNING 1u
#define KS_LOG_ERROR 2u

/* `text` has no newline and lives only during the call; called from any thread of the library, one at a time per device. */
typedef void (*ks_log_fn)(void* user, uint32_t level, const char* text);

/* `fraction` is 0..1 and never falls; called from the thread that called the library. Return nonzero to cancel:
 * the running call then returns KS_ERROR_CANCELLED, its outputs are unspecified, all objects stay valid. */
typedef int32_t (*ks_progress_fn)(void* user, float fraction);

/* Wall time of one named stage of the last call. */
typedef struct ks_stage_time {
  char name[32];
  double milliseconds;
} ks_stage_time;

#endif
