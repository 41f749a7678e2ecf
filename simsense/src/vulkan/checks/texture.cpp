// SPDX-License-Identifier: Apache-2.0
#include "vulkan/checks/texture.h"

#include "spirv/texture.h"
#include "vulkan/dispatch.h"
#include "vulkan/upload.h"

namespace simsense {

VulkanTexture::VulkanTexture(std::shared_ptr<ks::Device> device)
    : device_(std::move(device)), pipeline_(device_, texture_spirv, sizeof(TexturePush)) {}

void VulkanTexture::record(ks::Commands& commands, const StageSettings& settings, const ImageRef& left, const DeviceMaps& maps,
                           uint32_t width, uint32_t height, uint32_t pairs) {
  reserve(device_, blank_, uint64_t{width} * height * pairs);
  TexturePush push{};
  push.disparity = maps.disparity;
  push.confidence = maps.confidence;
  push.reason = maps.reason;
  push.blank = blank_->address();
  push.left = left;
  push.width = width;
  push.height = height;
  push.min_texture_dn = settings.texture.min_texture_dn;
  push.maps = maps.flags();
  push.invalid = settings.invalid_disparity();
  for (push.step = TEXTURE_PASS_FIND; push.step < TEXTURE_PASS_COUNT; ++push.step)
    dispatch_pixels(commands, pipeline_, push, width, height, pairs);
}

}  // namespace simsense
