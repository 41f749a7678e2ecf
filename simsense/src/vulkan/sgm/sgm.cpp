// SPDX-License-Identifier: Apache-2.0
#include "vulkan/match_steps.h"

#include <utility>

#include "spirv/block_paths_half.h"
#include "spirv/block_paths_integer.h"
#include "spirv/paths_half.h"
#include "spirv/paths_integer.h"
#include "vulkan/dispatch.h"
#include "vulkan/plan.h"

namespace simsense {
namespace {

/// part: PATHS_*
Constants path_constants(const MatchPlan& plan, const MatchParameters& p, uint32_t part) {
  const bool adds = (part == PATHS_COLUMNS && plan.sum_volumes == 1) || (part == PATHS_DIAGONALS && plan.sum_volumes < 4);
  Constants constants = lane_constants(plan, p, plan.path_group, plan.steps, {part, adds ? 1u : 0u});
  if (plan.sums_blocks()) constants.push_back(plan.path_group * plan.lane_disparities / 2);
  return constants;
}

std::span<const uint32_t> code(const MatchPlan& plan) {
  if (plan.sums_blocks()) return plan.half_minima ? std::span<const uint32_t>(block_paths_half_spirv) : block_paths_integer_spirv;
  return plan.half_minima ? std::span<const uint32_t>(paths_half_spirv) : paths_integer_spirv;
}

}  // namespace

VulkanSgm::VulkanSgm(const VulkanStep& step)
    : VulkanStep(step),
      paths_(*device_, code(plan_), sizeof(PathPush),
             path_constants(plan_, parameters_, plan_.rows_apart ? PATHS_ROWS : PATHS_ROWS_AND_COLUMNS), plan_.subgroup_lanes,
             {first_match_constant, match_constants(parameters_)}) {
  const auto make = [&](std::optional<ks::ComputePipeline>& slot, uint32_t part) {
    const auto shared = match_constants(parameters_);
    slot.emplace(*device_, code(plan_), sizeof(PathPush), path_constants(plan_, parameters_, part), plan_.subgroup_lanes,
                 ks::SharedConstants{first_match_constant, shared});
  };
  if (plan_.rows_apart) make(columns_, PATHS_COLUMNS);
  if (parameters_.path_count == 8) make(diagonals_, PATHS_DIAGONALS);
}

/// A dispatch that adds to another's results waits for it.
void VulkanSgm::record(ks::Commands& commands, const MatchBuffers& buffers, uint32_t pairs) const {
  PathPush push = path_push(plan_, parameters_, buffers);
  const uint32_t lines = plan_.path_group / plan_.path_lanes / 2;
  uint32_t row_groups = groups_of(plan_.height, lines), column_groups = 4 * groups_of(plan_.width, 4 * lines);
  if (plan_.sums_blocks()) {
    row_groups = groups_of(plan_.height, plan_.summed_lines - (parameters_.block_height - 1));
    column_groups = groups_of(plan_.width, plan_.summed_lines - (parameters_.block_width - 1));
  }
  commands.set_automatic_barriers(plan_.sum_volumes == 1);
  commands.dispatch(paths_, push, row_groups + (plan_.rows_apart ? 0 : column_groups), 1, pairs);
  if (columns_) commands.dispatch(*columns_, push, column_groups, 1, pairs);
  if (diagonals_) {
    if (plan_.sum_volumes == 2) commands.barrier();
    if (plan_.sum_volumes == 4) push.first_sums = buffers.sums[2]->address(), push.second_sums = buffers.sums[3]->address();
    commands.dispatch(*diagonals_, push, 2 * column_groups, 1, pairs);
  }
  commands.set_automatic_barriers(true);
  commands.barrier();
}

}  // namespace simsense
