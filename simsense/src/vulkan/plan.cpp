// SPDX-License-Identifier: Apache-2.0
#include "vulkan/plan.h"

#include <algorithm>
#include <bit>

#include "device/error.h"
#include "shared/match_push.h"
#include "shared/signal_push.h"

namespace simsense {
namespace {

constexpr uint32_t half_bias = 0x0400, largest_half = 0x7bff;  // as in path_state.glsl

/// CPU devices emulate half floats, several times slower than integers.
bool want_half_minima(const ks::Device& device, Minima minima) {
  if (minima == Minima::integer || (minima == Minima::automatic && device.is_cpu())) return false;
  return device.features12().shaderFloat16 == VK_TRUE;
}

uint32_t divide_up(uint32_t a, uint32_t b) { return (a + b - 1) / b; }

/// Lanes of one path: with few pairs many lanes shorten its steps, with many pairs few lanes waste less on their exchange.
void choose_lanes(MatchPlan& plan, const ks::Device& device, uint32_t disparities, uint32_t batch, const MatchTuning& tuning) {
  const uint32_t unit = plan.stored_costs ? 8 : 4;  // the block stage takes four pairs at a time
  const uint32_t wanted = divide_up(disparities, disparities <= (batch == 1 ? 128u : 64u) ? 8 : 16);
  plan.path_lanes = tuning.path_lanes ? tuning.path_lanes : std::clamp(std::bit_ceil(wanted), 4u, std::min(plan.subgroup_lanes, 32u));
  plan.lane_disparities = unit * divide_up(disparities, unit * plan.path_lanes);
  // One pair's time is latency; costs from a volume come from farther than census words, and few of them leave registers free.
  const bool far_ahead = batch == 1 ? disparities <= 128 : plan.stored_costs && plan.lane_disparities == unit;
  plan.steps = tuning.steps ? tuning.steps : far_ahead && !device.is_cpu() ? 8u : 4u;
  if (!std::has_single_bit(plan.path_lanes) || plan.path_lanes < 4 || plan.path_lanes > plan.subgroup_lanes || plan.path_lanes > 32 ||
      (plan.steps != 4 && plan.steps != 8))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "path_lanes is %u, steps %u: need a power of two of 4..%u and 4 or 8", plan.path_lanes, plan.steps,
             std::min(plan.subgroup_lanes, 32u));
}

void choose_ranges(MatchPlan& plan, const MatchParameters& p, uint32_t batch, bool half) {
  const uint32_t area = p.block_width * p.block_height;
  plan.p1 = p.p1 * area;
  plan.p2 = p.p2 * area;
  const uint32_t largest = p.census_bits() * area + plan.p2;  // of one path's costs
  // Opposite paths share a volume. Where that needs more than a byte per element anyway, columns add to what the rows have left, or
  // diagonals to what both have: half of the memory for one more wait.
  const bool bytes = 2 * largest <= 0xff, wide = 4 * largest > 0xffff;
  plan.sum_volumes = plan.sums_blocks() ? 1 : p.path_count == 8 ? (bytes ? 4 : 2) : bytes || wide ? 2 : 1;
  plan.rows_apart = plan.sum_volumes == 1 || batch > 1;  // of one pair, columns fill what the few long rows leave free
  const uint32_t sum = p.path_count / plan.sum_volumes * largest;
  plan.sum_bytes = sum <= 0xff ? 1 : sum <= 0xffff ? 2 : 4;
  const uint32_t beside_line = area == 1 ? std::max(largest, 32 + plan.p2) : largest;  // paths begin early, on words of any bits
  plan.half_minima = half && half_bias + beside_line + plan.p1 <= largest_half;
  plan.packed_keys = half && plan.sum_bytes == 1 && largest < 119 && p.max_disparity <= 256 && plan.lane_disparities <= 32;
}

constexpr uint32_t most_across = 15;  // lines of a block that a workgroup's neighbours sum up

/// Whether paths may sum the costs of their blocks themselves; shared words take 16 bit with room for the changes.
bool can_sum_blocks(const MatchParameters& p) {
  const uint32_t across = std::max(p.block_width, p.block_height), area = p.block_area();
  return area > 1 && across <= most_across && p.census_bits() <= 32 && p.path_count == 4 && area * p.census_bits() + 64 * across <= 0xffff;
}

/// The most threads of a workgroup whose subgroups have a required size.
uint32_t most_invocations(const ks::Device& device, uint32_t subgroup_lanes) {
  const uint32_t most = device.limits().maxComputeWorkGroupInvocations;
  if (!device.can_require_subgroup_size(subgroup_lanes)) return most;
  VkPhysicalDeviceSubgroupSizeControlProperties control{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_SIZE_CONTROL_PROPERTIES};
  VkPhysicalDeviceProperties2 all{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &control};
  vkGetPhysicalDeviceProperties2(device.physical(), &all);
  return static_cast<uint32_t>(std::min<uint64_t>(most, uint64_t{control.maxComputeWorkgroupSubgroups} * subgroup_lanes));
}

/// As many lines as workgroups and shared memory allow: those at the edges are walked for their neighbours alone.
uint32_t summed_lines(const ks::Device& device, const MatchPlan& plan, const MatchParameters& p) {
  constexpr uint32_t wanted_invocations = 512, most_shared_bytes = 32768;
  const uint32_t invocations = std::min(wanted_invocations, most_invocations(device, plan.subgroup_lanes));
  const uint32_t lane_bytes = 2 * (plan.lane_disparities / 2) * sizeof(uint32_t);  // two turns
  const uint32_t lanes = std::min(invocations, std::min(most_shared_bytes, device.limits().maxComputeSharedMemorySize) / lane_bytes);
  const uint32_t whole_subgroups = std::max(plan.subgroup_lanes / (2 * plan.path_lanes), 1u);
  const uint32_t lines = lanes / plan.path_lanes / 2 / whole_subgroups * whole_subgroups;
  return lines >= std::max(p.block_width, p.block_height) + 1 ? lines : 0;
}

/// Many parts in a workgroup write long runs of memory; few leave it more columns, of which the block's width is lost. The rows above a
/// workgroup's first one are summed again, so it takes as many rows as leave enough workgroups.
void choose_block_stage(MatchPlan& plan, const MatchParameters& p) {
  constexpr uint32_t wanted_groups = 1024;
  const uint32_t parts = plan.padded_disparities() / 8;
  plan.block_group = 256;
  plan.block_group_parts = 16;
  while (plan.block_group_parts > 1 && (parts % plan.block_group_parts != 0 || plan.block_columns() < 4 * p.block_width))
    plan.block_group_parts /= 2;
  plan.block_group = std::min(plan.block_group, divide_up(divide_up(plan.width, 4) * plan.block_group_parts, 32) * 32);
  const uint32_t tiles =
      divide_up(plan.width, plan.block_columns() - 2 * plan.block_halo(p.block_width)) * (parts / plan.block_group_parts);
  const uint32_t wanted_rows = plan.height / std::max(wanted_groups / (tiles * plan.pairs_at_once), 1u);
  plan.block_rows_per_group = std::clamp(wanted_rows, std::max(16u, 2 * p.block_height), std::max(64u, 4 * p.block_height));
}

/// Enough sweeps to fill a large GPU and to keep them short; a sweep also takes the columns of one disparity range past its end.
uint32_t default_segments(const MatchPlan& plan, uint32_t disparities) {
  constexpr uint32_t wanted_subgroups = 4096, wanted_columns = 240;
  const uint64_t subgroups = std::max<uint64_t>(uint64_t{plan.height} * plan.pairs_at_once * plan.path_lanes / plan.subgroup_lanes, 1);
  const uint32_t most = std::max(plan.width / std::max(disparities / 2, 32u), 1u);
  return static_cast<uint32_t>(
      std::clamp<uint64_t>(std::max<uint64_t>(wanted_subgroups / subgroups, plan.width / wanted_columns), 1, most));
}

uint64_t device_memory_bytes(const ks::Device& device) {
  uint64_t largest = 0;
  const VkPhysicalDeviceMemoryProperties& memory = device.memory_properties();
  for (uint32_t i = 0; i < memory.memoryHeapCount; ++i)
    if (memory.memoryHeaps[i].flags & VK_MEMORY_HEAP_DEVICE_LOCAL_BIT) largest = std::max<uint64_t>(largest, memory.memoryHeaps[i].size);
  return largest;
}

uint64_t volume_bytes(const MatchPlan& one_pair) {
  return one_pair.sum_volumes * one_pair.sum_volume_bytes() + one_pair.cost_volume_bytes();
}

/// The part of a device's memory that volumes may take.
uint64_t volume_allowance_bytes(const ks::Device& device) { return device_memory_bytes(device) / 16; }

/// As many pairs as fill a large GPU with lanes of paths, the stage that has the fewest, and as the imager takes. A CPU device gains
/// nothing.
uint32_t default_pairs(const ks::Device& device, const MatchPlan& one_pair) {
  if (device.is_cpu()) return 1;
  constexpr uint32_t filling_lanes = 1u << 20, least_pairs = 32;
  const uint64_t filling = std::clamp(filling_lanes / (2 * one_pair.height * one_pair.path_lanes), least_pairs, signal_pairs);
  return static_cast<uint32_t>(std::clamp<uint64_t>(volume_allowance_bytes(device) / volume_bytes(one_pair), 1, filling));
}

/// Lanes and volumes for one pair. summed: block costs are, if a workgroup can hold enough lines.
MatchPlan plan_pair(const ks::Device& device, uint32_t width, uint32_t height, uint32_t batch, const MatchParameters& parameters,
                    const MatchTuning& tuning, bool summed) {
  MatchPlan plan;
  plan.width = width;
  plan.height = height;
  plan.subgroup_lanes = device.subgroup_size();
  plan.census_words = parameters.census_bits() > 32 ? 2 : 1;
  plan.stored_costs = !summed && (parameters.block_area() > 1 || plan.census_words > 1);
  choose_lanes(plan, device, parameters.max_disparity, batch, tuning);
  if (summed) plan.summed_lines = summed_lines(device, plan, parameters);
  if (summed && !plan.sums_blocks()) return plan_pair(device, width, height, batch, parameters, tuning, false);
  choose_ranges(plan, parameters, batch, want_half_minima(device, tuning.minima));
  return plan;
}

/// Stored block costs are faster, summed ones take less than half of the memory.
MatchPlan plan_pair(const ks::Device& device, uint32_t width, uint32_t height, uint32_t batch, const MatchParameters& parameters,
                    const MatchTuning& tuning) {
  const bool can_sum = can_sum_blocks(parameters), summed = can_sum && tuning.block_costs == BlockCosts::summed;
  const MatchPlan plan = plan_pair(device, width, height, batch, parameters, tuning, summed);
  const bool too_large =
      can_sum && tuning.block_costs == BlockCosts::automatic && !device.is_cpu() && volume_bytes(plan) > volume_allowance_bytes(device);
  return too_large ? plan_pair(device, width, height, batch, parameters, tuning, true) : plan;
}

}  // namespace

MatchPlan make_match_plan(const ks::Device& device, uint32_t width, uint32_t height, uint32_t batch, const MatchParameters& parameters,
                          const MatchTuning& tuning) {
  MatchPlan plan = plan_pair(device, width, height, batch, parameters, tuning);
  plan.census_copies = plan.stored_costs ? 1 : 4;
  plan.right_origin = plan.padded_disparities() + 32;                   // as far as a path reads ahead
  plan.right_pitch = divide_up(plan.right_origin + width + 32, 4) * 4;  // with room to read ahead, in groups of four
  const uint64_t most_pairs = std::max<uint64_t>(MatchPlan::most_array_words / plan.largest_array_words(), 1);
  const uint32_t wanted_pairs = tuning.pairs_at_once ? tuning.pairs_at_once : default_pairs(device, plan);
  plan.pairs_at_once = static_cast<uint32_t>(std::min<uint64_t>({batch, wanted_pairs, most_pairs}));
  if (plan.stored_costs) choose_block_stage(plan, parameters);
  plan.path_group = std::max({tuning.path_group ? tuning.path_group : 64u, plan.subgroup_lanes, 2 * plan.path_lanes});
  if (plan.sums_blocks()) plan.path_group = 2 * plan.summed_lines * plan.path_lanes;
  plan.winner_group = std::max({tuning.winner_group ? tuning.winner_group : batch == 1 ? 64u : 32u, plan.subgroup_lanes});
  plan.winner_steps = batch == 1 ? 2 : 4;
  plan.segments = tuning.segments ? std::min(tuning.segments, width) : default_segments(plan, parameters.max_disparity);
  return plan;
}

}  // namespace simsense
