// SPDX-License-Identifier: Apache-2.0
#include "vulkan/checks/reason.h"

#include "spirv/reason.h"
#include "vulkan/dispatch.h"

namespace simsense {

VulkanReason::VulkanReason(const std::shared_ptr<ks::Device>& device) : pipeline_(device, reason_spirv, sizeof(ReasonPush)) {}

void VulkanReason::record(ks::Commands& commands, const StageSettings& settings, uint64_t depth_block, const ImageRef& left,
                          const DeviceMaps& maps, uint32_t width, uint32_t height, uint32_t pairs) const {
  ReasonPush push{};
  push.block = depth_block;
  push.disparity = maps.disparity;
  push.reason = maps.reason;
  push.left = left;
  push.window_width = settings.reason.window_width;
  push.window_height = settings.reason.window_height;
  push.low_texture_dn = settings.reason.low_texture_dn;
  push.saturated_dn = settings.reason.saturated_dn;
  dispatch_pixels(commands, pipeline_, push, width, height, pairs);
}

}  // namespace simsense
