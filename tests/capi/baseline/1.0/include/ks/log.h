/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KS_LOG_H
#define KS_LOG_H
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#ifdef __cplusplus
extern "C" {
#endif
#define KS_LOG_INFO 0u
#define KS_LOG_WARNING 1u
#define KS_LOG_ERROR 2u
typedef void (*ks_log_fn)(void* user, uint32_t level, const char* text);
typedef int32_t (*ks_progress_fn)(void* user, float fraction);
typedef struct ks_stage_time {
  char name[32];
  double milliseconds;
} ks_stage_time;
#ifdef __cplusplus
}
#endif
#endif
