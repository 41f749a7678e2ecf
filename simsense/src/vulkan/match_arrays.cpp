// SPDX-License-Identifier: Apache-2.0
#include "vulkan/match_arrays.h"

#include "shared/refine_push.h"
#include "vulkan/dispatch.h"

namespace simsense {

MatchBuffers::MatchBuffers(const std::shared_ptr<ks::Device>& device, const MatchPlan& plan, const MatchParameters& parameters) {
  const auto allocate = [&](uint64_t bytes) {
    memory_bytes += bytes;
    return ks::Buffer::create(device, bytes, 0);
  };
  left_census = allocate((plan.pixels() + 2 * left_margin) * plan.census_words * 4);
  right_census = allocate(plan.right_copy_words() * plan.census_copies * plan.census_words * 4);
  if (parameters.p2_full_gradient_dn > 0) gray = allocate((plan.pixels() + 2 * left_margin) * 4);
  if (plan.cost_volume_bytes() > 0) cost = allocate(plan.cost_volume_bytes());
  for (uint32_t i = 0; i < plan.sum_volumes; ++i) sums[i] = allocate(plan.sum_volume_bytes());
  right_winner = allocate(plan.pixels() * 4);
  unchecked = allocate(plan.pixels() * 4);
  if (parameters.refines() || parameters.detects()) filtered = allocate(plan.pixels() * 4);
  if (parameters.detects()) high = allocate(plan.pixels()), energy = allocate(plan.pixels() * 4);
  if (!parameters.refines()) return;
  const uint64_t cell_count = uint64_t{groups_of(plan.width, REFINE_CELL)} * groups_of(plan.height, REFINE_CELL) * plan.pairs_at_once;
  cells = allocate(cell_count * REFINE_CELL_FIGURES * sizeof(float));
}

PathPush path_push(const MatchPlan& plan, const MatchParameters& parameters, const MatchBuffers& buffers) {
  PathPush push{};
  push.left_census = buffers.left_census->address();
  push.right_census = buffers.right_census->address();
  push.gray = buffers.gray ? buffers.gray->address() : 0;
  push.cost = buffers.cost ? buffers.cost->address() : 0;
  push.first_sums = buffers.sums[0]->address();
  push.second_sums = buffers.sums[plan.sum_volumes == 1 ? 0 : 1]->address();
  push.width = plan.width;
  push.height = plan.height;
  push.right_origin = plan.right_origin;
  push.right_pitch = plan.right_pitch;
  push.right_copy_words = static_cast<uint32_t>(plan.right_copy_words());
  push.p1 = plan.p1;
  push.p2 = plan.p2;
  push.p2_full_gradient_dn = parameters.p2_full_gradient_dn;
  return push;
}

}  // namespace simsense
