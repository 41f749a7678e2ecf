// SPDX-License-Identifier: Apache-2.0
#include "vulkan/checks/explain.h"

#include "spirv/explain.h"
#include "vulkan/dispatch.h"

namespace simsense {

VulkanExplain::VulkanExplain(const std::shared_ptr<ks::Device>& device) : pipeline_(device, explain_spirv, sizeof(ExplainPush)) {}

void VulkanExplain::record(ks::Commands& commands, const StageSettings& settings, uint64_t depth_block, const ImageRef& left,
                           const DeviceMaps& maps, uint32_t width, uint32_t height, uint32_t pairs) const {
  ExplainPush push{};
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
