// SPDX-License-Identifier: Apache-2.0
#include "vulkan/checks/cleaner.h"

#include "spirv/holes.h"
#include "spirv/islands.h"
#include "spirv/padding.h"
#include "vulkan/dispatch.h"
#include "vulkan/upload.h"

namespace simsense {

const ks::ComputePipeline& VulkanCleaner::pipeline(std::unique_ptr<ks::ComputePipeline>& slot, std::span<const uint32_t> code) {
  if (!slot) slot = std::make_unique<ks::ComputePipeline>(device_, code, sizeof(CleanPush));
  return *slot;
}

CleanPush VulkanCleaner::push_of(const StageSettings& settings, const DeviceMaps& maps) const {
  CleanPush push{};
  push.disparity = maps.disparity;
  push.confidence = maps.confidence;
  push.reason = maps.reason;
  push.maps = maps.flags();
  push.width = width_;
  push.height = height_;
  push.invalid = settings.invalid_disparity();
  push.max_diff_px = settings.speckle_max_diff_px;
  push.max_size = settings.speckle_max_size;
  push.filling = static_cast<uint32_t>(settings.hole_filling);
  push.x0 = settings.wanted.x0;
  push.y0 = settings.wanted.y0;
  push.x1 = settings.wanted.x1;
  push.y1 = settings.wanted.y1;
  return push;
}

void VulkanCleaner::drop_padding(ks::Commands& commands, const StageSettings& settings, const VulkanRectifier& rectifier,
                                 const DeviceMaps& maps, uint32_t pairs) {
  CleanPush push = push_of(settings, maps);
  push.x = rectifier.left_x();
  push.y = rectifier.left_y();
  dispatch_pixels(commands, pipeline(padding_, padding_spirv), push, width_, height_, pairs);
}

void VulkanCleaner::filter_speckles(ks::Commands& commands, const StageSettings& settings, const DeviceMaps& maps, uint32_t pairs) {
  CleanPush push = push_of(settings, maps);
  reserve(device_, parent_, word_bytes(pairs));
  reserve(device_, size_, word_bytes(pairs));
  push.parent = parent_->address();
  push.size = size_->address();
  for (push.step = ISLANDS_BEGIN; push.step < ISLANDS_PASSES; ++push.step)
    dispatch_pixels(commands, pipeline(islands_, islands_spirv), push, width_, height_, pairs);
}

void VulkanCleaner::fill_holes(ks::Commands& commands, const StageSettings& settings, const DeviceMaps& maps, uint32_t pairs) {
  CleanPush push = push_of(settings, maps);
  reserve(device_, parent_, word_bytes(pairs));
  push.parent = parent_->address();
  for (push.step = HOLES_GUESS; push.step < HOLES_PASSES; ++push.step)
    dispatch_pixels(commands, pipeline(holes_, holes_spirv), push, push.x1 - push.x0, push.y1 - push.y0, pairs);
}

}  // namespace simsense
