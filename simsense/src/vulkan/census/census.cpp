// SPDX-License-Identifier: Apache-2.0
#include "vulkan/match_steps.h"

#include "spirv/census.h"
#include "vulkan/dispatch.h"
#include "vulkan/plan.h"

namespace simsense {
namespace {

Constants census_constants(const MatchPlan& plan, const MatchParameters& p, uint32_t element_bytes) {
  return {plan.census_copies, static_cast<uint32_t>(p.census_kind), plan.census_words,
          element_bytes,      p.p2_full_gradient_dn > 0 ? 1u : 0u,  p.census_contrast_256ths};
}

}  // namespace

VulkanCensus::VulkanCensus(const VulkanStep& step)
    : VulkanStep(step),
      of_bytes_(*device_, census_spirv, sizeof(CensusPush), census_constants(plan_, parameters_, 1), 0,
                {first_match_constant, match_constants(parameters_)}) {}

void VulkanCensus::record(ks::Commands& commands, const MatchBuffers& buffers, const MatchArrays& arrays, uint32_t pairs) {
  if (arrays.element_bytes != 1 && !of_words_) {
    const auto shared = match_constants(parameters_);
    of_words_.emplace(*device_, census_spirv, sizeof(CensusPush), census_constants(plan_, parameters_, 2), 0,
                      ks::SharedConstants{first_match_constant, shared});
  }
  CensusPush push{};
  push.left_image = arrays.left & ~uint64_t{3};
  push.right_image = arrays.right & ~uint64_t{3};
  push.left_byte = arrays.left & 3;
  push.right_byte = arrays.right & 3;
  push.image_pitch = arrays.pitch(plan_);
  push.image_stride = arrays.stride(plan_);
  push.left_census = buffers.left_census->address();
  push.right_census = buffers.right_census->address();
  push.gray = buffers.gray ? buffers.gray->address() : 0;
  push.right_winner = buffers.right_winner->address();
  push.width = plan_.width;
  push.height = plan_.height;
  push.right_pitch = plan_.right_pitch;
  push.right_origin = plan_.right_origin;
  push.right_copy_words = static_cast<uint32_t>(plan_.right_copy_words());
  push.min_disparity = parameters_.min_disparity;
  commands.dispatch(arrays.element_bytes == 1 ? of_bytes_ : *of_words_, push,
                    groups_of(plan_.right_origin, 64) + groups_of(plan_.width, 64), groups_of(plan_.height, 16), 2 * pairs);
}

}  // namespace simsense
