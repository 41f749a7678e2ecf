/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KS_STATUS_H
#define KS_STATUS_H
#include <stdint.h>
typedef int32_t ks_status;
#define KS_OK 0
#define KS_ERROR_INVALID_ARGUMENT (-1)
#define KS_ERROR_INVALID_STATE (-2)
#define KS_ERROR_UNSUPPORTED (-3)
#define KS_ERROR_OUT_OF_HOST_MEMORY (-4)
#define KS_ERROR_OUT_OF_DEVICE_MEMORY (-5)
#define KS_ERROR_DEVICE_LOST (-6)
#define KS_ERROR_NO_DEVICE (-7)
#define KS_ERROR_CANCELLED (-8)
#define KS_ERROR_TIMEOUT (-9)
#define KS_ERROR_VERSION (-10)
#define KS_ERROR_FILE (-11)
#define KS_ERROR_INTERNAL (-12)
static inline const char* ks_status_name(ks_status status) {
  switch (status) {
    case KS_OK: return "ok";
    case KS_ERROR_INVALID_ARGUMENT: return "invalid argument";
    case KS_ERROR_INVALID_STATE: return "invalid state";
    case KS_ERROR_UNSUPPORTED: return "unsupported";
    case KS_ERROR_OUT_OF_HOST_MEMORY: return "out of host memory";
    case KS_ERROR_OUT_OF_DEVICE_MEMORY: return "out of device memory";
    case KS_ERROR_DEVICE_LOST: return "device lost";
    case KS_ERROR_NO_DEVICE: return "no usable device";
    case KS_ERROR_CANCELLED: return "cancelled";
    case KS_ERROR_TIMEOUT: return "timeout";
    case KS_ERROR_VERSION: return "version mismatch";
    case KS_ERROR_FILE: return "file error";
    case KS_ERROR_INTERNAL: return "internal error";
    default: return "unknown status";
  }
}
#endif
