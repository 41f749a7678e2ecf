// SPDX-License-Identifier: Apache-2.0
// Version, last error, device and buffer functions of simsense's C API; the text of the latter two is capi/device/c_api.inc.
#include "api/handles.h"
#include "device/error.h"
#include "simsense/simsense.h"

extern "C" uint32_t simsense_version(void) {
  return SIMSENSE_VERSION_MAJOR * 10000 + SIMSENSE_VERSION_MINOR * 100 + SIMSENSE_VERSION_PATCH;
}

extern "C" const char* simsense_last_error(void) { return ks::last_error(); }

#define KS_PREFIX simsense
#define KS_ACCEPTS_HOST true
#include "device/c_api.inc"
