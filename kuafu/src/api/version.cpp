// SPDX-License-Identifier: Apache-2.0
#include "device/error.h"
#include "kuafu/kuafu.h"

extern "C" uint32_t kuafu_version(void) { return KUAFU_VERSION_MAJOR * 10000 + KUAFU_VERSION_MINOR * 100 + KUAFU_VERSION_PATCH; }

extern "C" const char* kuafu_last_error(void) { return ks::last_error(); }
