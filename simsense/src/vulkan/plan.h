// SPDX-License-Identifier: Apache-2.0
// How the matcher's work is laid out on a device: lanes and registers of a path, element sizes, workgroups, and how many pairs go through
// at a time. Plain values, decided once.
#pragma once

#include <algorithm>
#include <initializer_list>
#include <vector>

#include "device/device.h"
#include "match/matcher.h"

namespace simsense {

/// How the path stage takes minima: as pairs of half floats, if the device has them and the costs fit, or as integers.
enum class Minima : uint8_t { automatic, half, integer };

/// How a block's costs reach the paths: from a volume in memory, or summed again by each path, in less than half of the memory.
enum class BlockCosts : uint8_t { automatic, stored, summed };

/// Values that a caller may fix for measurements or tests; 0 = the device's default.
struct MatchTuning {
  uint32_t path_lanes = 0;     // power of two, 4 .. subgroup size
  uint32_t steps = 0;          // pixels that a path reads ahead: 4 or 8
  uint32_t path_group = 0;     // invocations per workgroup of the path stage
  uint32_t winner_group = 0;   // of the winner stage
  uint32_t segments = 0;       // parts of a row in the winner stage
  uint32_t pairs_at_once = 0;  // pairs that share one pass through the stages
  Minima minima = Minima::automatic;
  BlockCosts block_costs = BlockCosts::automatic;
};

struct MatchPlan {
  uint32_t width = 0, height = 0, pairs_at_once = 1;
  uint32_t subgroup_lanes = 0, path_lanes = 0, lane_disparities = 0, steps = 0;
  uint32_t sum_bytes = 0;  // per element of a volume of path costs
  bool half_minima = false;
  bool rows_apart = false;    // rows in a dispatch of their own
  bool packed_keys = false;   // winners from 16-bit keys
  bool stored_costs = false;  // in a volume, not made of census words where a path needs them
  uint32_t summed_lines = 0;  // where block costs are summed by the paths: lines of a workgroup, those at its edges included; else 0
  uint32_t p1 = 0, p2 = 0;    // times the block's area
  uint32_t path_group = 0, winner_group = 0, segments = 0;
  uint32_t winner_steps = 0;  // pixels that the winner stage reads ahead
  uint32_t census_copies = 0, census_words = 1, right_origin = 0, right_pitch = 0;
  uint32_t sum_volumes = 0;  // of path costs
  uint32_t block_group = 0, block_group_parts = 0,
           block_rows_per_group = 0;  // block stage: invocations, parts of 4 pairs of disparities, rows

  [[nodiscard]] uint32_t padded_disparities() const { return path_lanes * lane_disparities; }
  /// Columns that a workgroup of the block stage sums, and those beside its output: none where it has the whole width.
  [[nodiscard]] uint32_t block_columns() const { return block_group / block_group_parts * 4; }
  [[nodiscard]] uint32_t block_halo(uint32_t block_width) const { return block_columns() >= width ? 0 : (block_width / 2 + 3) / 4 * 4; }
  [[nodiscard]] uint64_t pixels() const { return uint64_t{width} * height * pairs_at_once; }
  [[nodiscard]] bool sums_blocks() const { return summed_lines > 0; }
  /// Bytes of one volume.
  [[nodiscard]] uint64_t sum_volume_bytes() const { return pixels() * padded_disparities() * sum_bytes; }
  [[nodiscard]] uint64_t cost_volume_bytes() const { return stored_costs ? pixels() * padded_disparities() * 2 : 0; }
  [[nodiscard]] uint64_t right_copy_words() const { return uint64_t{right_pitch} * height * pairs_at_once; }
  /// Shaders count words by positive 32-bit integers.
  static constexpr uint64_t most_array_words = INT32_MAX;
  [[nodiscard]] uint64_t largest_array_words() const {
    return std::max({sum_volume_bytes() / 4, cost_volume_bytes() / 4, uint64_t{census_copies} * census_words * right_copy_words()});
  }
};

MatchPlan make_match_plan(const ks::Device& device, uint32_t width, uint32_t height, uint32_t batch, const MatchParameters& parameters,
                          const MatchTuning& tuning);

// The specialisation constants of lib/lanes.glsl, which the cost, path and winner stages share.
using Constants = std::vector<uint32_t>;

inline Constants lane_constants(const MatchPlan& plan, const MatchParameters& p, uint32_t group, uint32_t steps,
                                std::initializer_list<uint32_t> more) {
  Constants constants{group,
                      plan.path_lanes,
                      plan.lane_disparities,
                      plan.subgroup_lanes,
                      plan.sum_bytes,
                      steps,
                      static_cast<uint32_t>(p.subpixel),
                      plan.stored_costs ? 1u : 0u,
                      p.path_count,
                      plan.census_words,
                      p.p2_full_gradient_dn > 0 ? 1u : 0u};
  constants.insert(constants.end(), more);
  return constants;
}

}  // namespace simsense
