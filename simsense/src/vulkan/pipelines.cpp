#include "vulkan/pipelines.h"

#include <vector>

#include "shared/match_push.h"
#include "spirv/block_cost.h"
#include "spirv/block_paths_half.h"
#include "spirv/block_paths_integer.h"
#include "spirv/census.h"
#include "spirv/finish.h"
#include "spirv/paths_half.h"
#include "spirv/paths_integer.h"
#include "spirv/winner.h"
#include "spirv/winner_packed.h"

namespace simsense {
namespace {

using Constants = std::vector<uint32_t>;

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
          static_cast<uint32_t>(p.subpixel),
          plan.stored_costs ? 1u : 0u,
          p.path_count,
          plan.census_words,
          p.p2_full_gradient > 0 ? 1u : 0u};
}

Constants with(Constants constants, std::initializer_list<uint32_t> more) {
  constants.insert(constants.end(), more);
  return constants;
}

Constants block_constants(const MatchPlan& plan, const MatchParameters& p) {
  return with(lane_constants(plan, p, 256, plan.steps), {p.block_width, p.block_height, plan.block_group_parts, plan.block_rows_per_group});
}

enum PathPart : uint32_t { rows_and_columns, diagonals_alone, rows_alone, columns_alone };  // as in walk.glsl

Constants path_constants(const MatchPlan& plan, const MatchParameters& p, PathPart part) {
  const bool adds = (part == columns_alone && plan.sum_volumes == 1) || (part == diagonals_alone && plan.sum_volumes < 4);
  Constants constants = with(lane_constants(plan, p, plan.path_group, plan.steps), {part, adds ? 1u : 0u});
  if (!plan.sums_blocks()) return constants;
  return with(std::move(constants), {p.block_width, p.block_height, plan.path_group * plan.lane_disparities / 2});
}

Constants winner_constants(const MatchPlan& plan, const MatchParameters& p) {
  return with(lane_constants(plan, p, plan.winner_group, plan.winner_steps),
              {plan.segments, plan.sum_volumes, p.block_width, p.block_height});
}

Constants census_constants(const MatchPlan& plan, const MatchParameters& p, uint32_t element_bytes) {
  return {p.census_width,
          p.census_height,
          plan.census_copies,
          p.census == CensusKind::plain ? 1u : 0u,
          plan.census_words,
          element_bytes,
          p.p2_full_gradient > 0 ? 1u : 0u,
          p.census_contrast};
}

std::span<const uint32_t> paths_code(const MatchPlan& plan) {
  if (plan.sums_blocks()) return plan.half_minima ? std::span<const uint32_t>(block_paths_half_spirv) : block_paths_integer_spirv;
  return plan.half_minima ? std::span<const uint32_t>(paths_half_spirv) : paths_integer_spirv;
}

std::span<const uint32_t> winner_code(const MatchPlan& plan) {
  return plan.packed_keys ? std::span<const uint32_t>(winner_packed_spirv) : winner_spirv;
}

}  // namespace

MatchPipelines::MatchPipelines(const std::shared_ptr<ks::Device>& device, const MatchPlan& plan, const MatchParameters& p)
    : census_8(device, census_spirv, sizeof(CensusPush), census_constants(plan, p, 1)),
      paths(device, paths_code(plan), sizeof(PathPush), path_constants(plan, p, plan.rows_apart ? rows_alone : rows_and_columns),
            plan.subgroup_lanes),
      winner(device, winner_code(plan), sizeof(WinnerPush), winner_constants(plan, p), plan.subgroup_lanes),
      finish(device, finish_spirv, sizeof(FinishPush), Constants{p.median_size}) {
  if (plan.stored_costs) block_cost.emplace(device, block_cost_spirv, sizeof(PathPush), block_constants(plan, p));
  if (plan.rows_apart)
    columns.emplace(device, paths_code(plan), sizeof(PathPush), path_constants(plan, p, columns_alone), plan.subgroup_lanes);
  if (p.path_count == 8)
    diagonals.emplace(device, paths_code(plan), sizeof(PathPush), path_constants(plan, p, diagonals_alone), plan.subgroup_lanes);
}

const ks::ComputePipeline& MatchPipelines::census(const std::shared_ptr<ks::Device>& device, const MatchPlan& plan,
                                                  const MatchParameters& p, uint32_t element_bytes) {
  if (element_bytes == 1) return census_8;
  if (!census_16) census_16.emplace(device, census_spirv, sizeof(CensusPush), census_constants(plan, p, 2));
  return *census_16;
}

}  // namespace simsense
