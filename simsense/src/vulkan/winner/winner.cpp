// SPDX-License-Identifier: Apache-2.0
#include "vulkan/match_steps.h"

#include "spirv/winner_packed.h"
#include "spirv/winner_wide.h"
#include "vulkan/dispatch.h"
#include "vulkan/plan.h"

namespace simsense {
namespace {

std::span<const uint32_t> code(const MatchPlan& plan) {
  return plan.packed_keys ? std::span<const uint32_t>(winner_packed_spirv) : winner_wide_spirv;
}

}  // namespace

VulkanWinner::VulkanWinner(const VulkanStep& step)
    : VulkanStep(step),
      pipeline_(*device_, code(plan_), sizeof(WinnerPush),
                lane_constants(plan_, parameters_, plan_.winner_group, plan_.winner_steps, {plan_.segments, plan_.sum_volumes}),
                plan_.subgroup_lanes, {first_match_constant, match_constants(parameters_)}) {}

void VulkanWinner::record(ks::Commands& commands, const MatchBuffers& buffers, const MatchArrays& arrays, uint32_t pairs) const {
  WinnerPush push{};
  for (uint32_t i = 0; i < plan_.sum_volumes; ++i) push.sums[i] = buffers.sums[i]->address();
  push.cost = buffers.cost ? buffers.cost->address() : 0;
  push.left_census = buffers.left_census->address();
  push.right_census = buffers.right_census->address();
  push.right_winner = buffers.right_winner->address();
  push.unchecked = buffers.unchecked->address();
  push.confidence = arrays.confidence;
  push.width = plan_.width;
  push.height = plan_.height;
  push.right_origin = plan_.right_origin;
  push.right_pitch = plan_.right_pitch;
  push.min_disparity = parameters_.min_disparity;
  push.maps = arrays.maps();
  commands.dispatch(pipeline_, push, groups_of(plan_.height, plan_.winner_group / plan_.path_lanes), plan_.segments, pairs);
}

}  // namespace simsense
