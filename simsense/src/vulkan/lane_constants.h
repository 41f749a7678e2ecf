// SPDX-License-Identifier: Apache-2.0
// The specialisation constants of lib/lanes.glsl, which the cost, path and winner stages share.
#pragma once

#include <initializer_list>
#include <vector>

#include "vulkan/plan.h"

namespace simsense {

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
