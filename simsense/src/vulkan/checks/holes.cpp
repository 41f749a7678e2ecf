// SPDX-License-Identifier: Apache-2.0
#include "vulkan/checks/holes.h"

#include "spirv/holes.h"
#include "vulkan/dispatch.h"
#include "vulkan/upload.h"

namespace simsense {

VulkanHoleFilling::VulkanHoleFilling(std::shared_ptr<ks::Device> device)
    : device_(std::move(device)), pipeline_(device_, holes_spirv, sizeof(CleanPush)) {}

void VulkanHoleFilling::record(ks::Commands& commands, CleanPush push, uint32_t pairs) {
  reserve(device_, guesses_, uint64_t{push.width} * push.height * pairs * sizeof(uint32_t));
  push.parent = guesses_->address();
  for (push.step = HOLES_PASS_GUESS; push.step < HOLES_PASS_COUNT; ++push.step)
    dispatch_pixels(commands, pipeline_, push, push.x1 - push.x0, push.y1 - push.y0, pairs);
}

}  // namespace simsense
