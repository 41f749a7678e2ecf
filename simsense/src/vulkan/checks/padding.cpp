// SPDX-License-Identifier: Apache-2.0
#include "vulkan/checks/padding.h"

#include "spirv/padding.h"
#include "vulkan/dispatch.h"

namespace simsense {

VulkanPadding::VulkanPadding(const std::shared_ptr<ks::Device>& device) : pipeline_(device, padding_spirv, sizeof(CleanPush)) {}

void VulkanPadding::record(ks::Commands& commands, CleanPush push, const VulkanRemap& remap, uint32_t pairs) const {
  push.x = remap.left_x();
  push.y = remap.left_y();
  dispatch_pixels(commands, pipeline_, push, push.width, push.height, pairs);
}

}  // namespace simsense
