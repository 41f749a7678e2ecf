// SPDX-License-Identifier: Apache-2.0
#include "vulkan/checks/speckle.h"

#include "spirv/speckle.h"
#include "vulkan/dispatch.h"
#include "vulkan/upload.h"

namespace simsense {

VulkanSpeckleFilter::VulkanSpeckleFilter(std::shared_ptr<ks::Device> device)
    : device_(std::move(device)), pipeline_(device_, speckle_spirv, sizeof(CleanPush)) {}

void VulkanSpeckleFilter::record(ks::Commands& commands, CleanPush push, uint32_t pairs) {
  const uint64_t bytes = uint64_t{push.width} * push.height * pairs * sizeof(uint32_t);
  reserve(device_, parent_, bytes);
  reserve(device_, size_, bytes);
  push.parent = parent_->address();
  push.size = size_->address();
  for (push.step = SPECKLE_BEGIN; push.step < SPECKLE_PASSES; ++push.step)
    dispatch_pixels(commands, pipeline_, push, push.width, push.height, pairs);
}

}  // namespace simsense
