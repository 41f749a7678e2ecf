#include "vulkan/pipelines.h"

#include <vector>

#include "shared/match_push.h"
#include "spirv/block_cost.h"
#include "spirv/census.h"
#include "spirv/finish.h"
#include "spirv/paths_half.h"
#include "spirv/paths_integer.h"
#include "spirv/winner.h"

namespace simsense {
namespace {

using Constants = std::vector<uint32_t>;

constexpr uint32_t winner_steps = 4;  // pixels that the winner stage reads ahead

/// The constants of lanes.glsl.
Constants lane_constants(const MatchPlan& plan, const MatchParameters& p, uint32_t group, uint32_t steps) {
  return {group,
          plan.path_lanes,
          plan.lane_disparities,
          p.max_disparity,
          plan.subgroup_lanes,
          plan.sum_bytes,
          p.block_width * p.block_height,
          steps,
          p.uniqueness_ratio,
          static_cast<uint32_t>(p.subpixel)};
}

Constants block_constants(const MatchPlan& plan, const MatchParameters& p) {
  Constants constants = lane_constants(plan, p, 256, plan.steps);
  constants.insert(constants.end(), {p.block_width, p.block_height, plan.block_group_parts, plan.block_rows_per_group});
  return constants;
}

std::span<const uint32_t> paths_code(bool half) { return half ? std::span<const uint32_t>(paths_half_spirv) : paths_integer_spirv; }

}  // namespace

MatchPipelines::MatchPipelines(const std::shared_ptr<ks::Device>& device, const MatchPlan& plan, const MatchParameters& p)
    : census(device, census_spirv, sizeof(MatchPush), Constants{p.census_width, p.census_height, plan.census_copies}),
      paths(device, paths_code(plan.half_minima), sizeof(MatchPush), lane_constants(plan, p, plan.path_group, plan.steps),
            plan.subgroup_lanes),
      winner(device, winner_spirv, sizeof(MatchPush), lane_constants(plan, p, plan.winner_group, winner_steps), plan.subgroup_lanes),
      finish(device, finish_spirv, sizeof(MatchPush), Constants{p.median_size}) {
  if (p.block_width * p.block_height > 1) block_cost.emplace(device, block_cost_spirv, sizeof(MatchPush), block_constants(plan, p));
}

}  // namespace simsense
