// SPDX-License-Identifier: Apache-2.0
// Device and buffer functions of kuafu's C API; their text is capi/device/c_api.inc.
#include "api/handles.h"
#include "kuafu/kuafu.h"

#define KS_PREFIX kuafu
#define KS_ACCEPTS_HOST false
#include "device/c_api.inc"
