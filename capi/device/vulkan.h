// SPDX-License-Identifier: Apache-2.0
// The Vulkan declarations through volk: the loader is opened at run time, never linked, and each device has its own function table.
#pragma once

#include <volk.h>

namespace ks {

/// Throws ks::Error for a negative VkResult; `what` names the call and its sizes.
void check(VkResult result, const char* what);
const char* result_name(VkResult result);

}  // namespace ks
