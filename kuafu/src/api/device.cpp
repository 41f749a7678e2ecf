// SPDX-License-Identifier: Apache-2.0
// Version, last error, device and buffer functions of kuafu's C API; the text of the latter two is capi/device/c_api.inc.
#include "api/handles.h"
#include "device/error.h"
#include "kuafu/kuafu.h"

extern "C" uint32_t kuafu_version(void) { return KUAFU_VERSION_MAJOR * 10000 + KUAFU_VERSION_MINOR * 100 + KUAFU_VERSION_PATCH; }

extern "C" const char* kuafu_last_error(void) { return ks::last_error(); }

#define KS_PREFIX kuafu
#define KS_ACCEPTS_HOST false
#include "device/c_api.inc"
