// SPDX-License-Identifier: Apache-2.0
// Device and buffer functions of simsense's C API; their text is capi/device/c_api.inc.
#include "api/handles.h"
#include "simsense/simsense.h"

#define KS_PREFIX simsense
#define KS_ACCEPTS_HOST true
#include "device/c_api.inc"
