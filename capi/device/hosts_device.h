// SPDX-License-Identifier: Apache-2.0
// A VkDevice that the host program has made (KS_SELECT_VULKAN): what it can do for us, as far as the host enabled it.
#pragma once

#include "device/physical.h"
#include "ks/device.h"

namespace ks {

/// The physical device's facts, less the features and extensions that the host's VkDeviceCreateInfo did not enable, for the queue that the
/// host gave. Throws KS_ERROR_INVALID_ARGUMENT for a missing handle or a queue family without compute.
PhysicalFacts hosts_facts(const ks_vulkan_device& host);

}  // namespace ks
