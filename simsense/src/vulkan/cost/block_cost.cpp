// SPDX-License-Identifier: Apache-2.0
#include "vulkan/match_steps.h"

#include "spirv/block_cost.h"
#include "vulkan/dispatch.h"
#include "vulkan/plan.h"

namespace simsense {

VulkanBlockCost::VulkanBlockCost(const VulkanStep& step)
    : VulkanStep(step),
      pipeline_(*device_, block_cost_spirv, sizeof(PathPush),
                lane_constants(plan_, parameters_, plan_.block_group, plan_.steps,
                               {plan_.block_group_parts, plan_.block_rows_per_group, plan_.block_columns(),
                                plan_.block_halo(parameters_.block_width)}),
                0, {first_match_constant, match_constants(parameters_)}) {}

void VulkanBlockCost::record(ks::Commands& commands, const MatchBuffers& buffers, uint32_t pairs) const {
  const uint32_t part_groups = plan_.padded_disparities() / 8 / plan_.block_group_parts;
  const uint32_t outputs = plan_.block_columns() - 2 * plan_.block_halo(parameters_.block_width);
  commands.dispatch(pipeline_, path_push(plan_, parameters_, buffers), part_groups * groups_of(plan_.width, outputs),
                    groups_of(plan_.height, plan_.block_rows_per_group), pairs);
}

}  // namespace simsense
