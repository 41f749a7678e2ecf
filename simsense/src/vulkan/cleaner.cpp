#include "vulkan/cleaner.h"

#include "spirv/holes.h"
#include "spirv/islands.h"
#include "spirv/padding.h"
#include "vulkan/dispatch.h"

namespace simsense {
namespace {

void reserve(const std::shared_ptr<ks::Device>& device, std::shared_ptr<ks::Buffer>& buffer, uint64_t bytes) {
  if (!buffer || buffer->size_bytes() < bytes) buffer = ks::Buffer::create(device, bytes, 0);
}

}  // namespace

const ks::ComputePipeline& VulkanCleaner::pipeline(std::unique_ptr<ks::ComputePipeline>& slot, std::span<const uint32_t> code) {
  if (!slot) slot = std::make_unique<ks::ComputePipeline>(device_, code, sizeof(CleanPush));
  return *slot;
}

void VulkanCleaner::record_padding(ks::Commands& commands, CleanPush push, uint32_t pairs) {
  push.x = rectifier_->left_x();
  push.y = rectifier_->left_y();
  dispatch_pixels(commands, pipeline(padding_, padding_spirv), push, width_, height_, pairs);
}

void VulkanCleaner::record_speckle_filter(ks::Commands& commands, CleanPush push, uint32_t pairs) {
  reserve(device_, size_, uint64_t{width_} * height_ * pairs * sizeof(uint32_t));
  push.size = size_->address();
  for (push.step = 0; push.step < 4; ++push.step)
    dispatch_pixels(commands, pipeline(islands_, islands_spirv), push, width_, height_, pairs);
}

void VulkanCleaner::record_hole_filling(ks::Commands& commands, CleanPush push, uint32_t pairs) {
  for (push.step = 0; push.step < 2; ++push.step)
    dispatch_pixels(commands, pipeline(holes_, holes_spirv), push, push.x1 - push.x0, push.y1 - push.y0, pairs);
}

void VulkanCleaner::record(ks::Commands& commands, const CleanRequest& request, const DeviceMaps& maps, uint32_t pairs) {
  CleanPush push{};
  push.disparity = maps.disparity;
  push.confidence = maps.confidence;
  push.reason = maps.reason;
  push.maps = (maps.confidence ? CLEAN_HAS_CONFIDENCE : 0u) | (maps.reason ? CLEAN_HAS_REASON : 0u);
  push.width = width_;
  push.height = height_;
  push.invalid = request.invalid;
  push.max_diff_px = request.speckle_max_diff_px;
  push.max_size = request.speckle_max_size;
  push.filling = static_cast<uint32_t>(request.filling);
  push.x0 = request.region.x0;
  push.y0 = request.region.y0;
  push.x1 = request.region.x1;
  push.y1 = request.region.y1;
  const bool speckles = request.speckle_max_size > 0, holes = request.filling != HoleFilling::none;
  if (speckles || holes) {
    reserve(device_, parent_, uint64_t{width_} * height_ * pairs * sizeof(uint32_t));
    push.parent = parent_->address();
  }
  const auto stage = [&](const char* name, bool wanted, auto record_stage) {
    if (!wanted) return;
    commands.begin_stage(name);
    (this->*record_stage)(commands, push, pairs);
  };
  stage("rectify", request.drop_padding, &VulkanCleaner::record_padding);
  stage("speckle filter", speckles, &VulkanCleaner::record_speckle_filter);
  stage("hole filling", holes, &VulkanCleaner::record_hole_filling);
  stage("rectify", holes && request.drop_padding, &VulkanCleaner::record_padding);
}

}  // namespace simsense
