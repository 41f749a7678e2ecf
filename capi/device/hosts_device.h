// SPDX-License-Identifier: Apache-2.0
// A VkDevice that the host program made (KS_SELECT_VULKAN), and its capabilities as far as the host enabled them.
#pragma once

#include "device/physical.h"
#include "ks/device.h"

namespace ks {

/// Returns the physical device's facts for the host's queue, without the features and extensions that its VkDeviceCreateInfo left off.
/// Throws KS_ERROR_INVALID_ARGUMENT for a missing handle or a queue family without compute.
PhysicalFacts hosts_facts(const ks_vulkan_device& host);

}  // namespace ks
