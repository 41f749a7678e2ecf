// SPDX-License-Identifier: Apache-2.0
#include "vulkan/checks/edges.h"

#include "spirv/edges.h"
#include "vulkan/dispatch.h"
#include "vulkan/upload.h"

namespace simsense {

VulkanEdges::VulkanEdges(std::shared_ptr<ks::Device> device)
    : device_(std::move(device)), pipeline_(device_, edges_spirv, sizeof(CleanPush)) {}

void VulkanEdges::record(ks::Commands& commands, CleanPush push, const EdgeParameters& p, uint32_t pairs) {
  reserve(device_, marks_, uint64_t{push.width} * push.height * pairs * sizeof(uint32_t));
  push.parent = marks_->address();
  push.max_diff_px = p.step_px;
  push.max_size = p.border_px;
  for (push.step = EDGES_PASS_MARK; push.step < EDGES_PASS_COUNT; ++push.step)
    dispatch_pixels(commands, pipeline_, push, push.width, push.height, pairs);
}

}  // namespace simsense
