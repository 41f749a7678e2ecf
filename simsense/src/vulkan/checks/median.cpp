// SPDX-License-Identifier: Apache-2.0
#include "vulkan/match_steps.h"

#include "spirv/median.h"
#include "vulkan/dispatch.h"
#include "vulkan/plan.h"

namespace simsense {

VulkanMedian::VulkanMedian(const VulkanStep& step)
    : VulkanStep(step),
      pipeline_(*device_, median_spirv, sizeof(MedianPush), {}, 0, {first_match_constant, match_constants(parameters_)}) {}

void VulkanMedian::record(ks::Commands& commands, const MatchBuffers& buffers, const MatchArrays& arrays, uint32_t pairs) const {
  MedianPush push{};
  push.right_winner = buffers.right_winner->address();
  push.unchecked = buffers.unchecked->address();
  push.disparity = buffers.after_median(arrays);
  push.confidence = arrays.confidence;
  push.reason = arrays.reason;
  push.width = plan_.width;
  push.height = plan_.height;
  push.lr_max_diff = parameters_.lr_max_diff;
  push.min_disparity = parameters_.min_disparity;
  push.maps = arrays.maps();
  commands.dispatch(pipeline_, push, groups_of(plan_.width, 32), groups_of(plan_.height, 16), pairs);
}

}  // namespace simsense
