// SPDX-License-Identifier: Apache-2.0
// Which of the Vulkan devices a ks_device_desc means.
#pragma once

#include <string>
#include <vector>

#include "ks/device.h"

namespace ks {

/// Returns the index of the chosen device. Throws KS_ERROR_NO_DEVICE with every device's reasons; `why_none` is the reason if the list is
/// empty.
size_t select_device(const std::vector<ks_device_info>& devices, const ks_device_desc& desc, const std::string& why_none);

}  // namespace ks
