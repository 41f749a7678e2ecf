// SPDX-License-Identifier: Apache-2.0
#include "vulkan/match_steps.h"

#include "shared/refine_push.h"
#include "spirv/refine.h"
#include "spirv/refine_cells.h"
#include "spirv/refine_move.h"
#include "vulkan/dispatch.h"
#include "vulkan/plan.h"

namespace simsense {

VulkanRefinement::Passes::Passes(const ks::Device& device, uint32_t element_bytes)
    : cells(device, refine_cells_spirv, sizeof(RefinePush), Constants{element_bytes}),
      move(device, refine_move_spirv, sizeof(RefinePush), Constants{element_bytes}),
      windows(device, refine_spirv, sizeof(RefinePush), Constants{element_bytes}) {}

VulkanRefinement::VulkanRefinement(const VulkanStep& step) : VulkanStep(step), of_bytes_(*device_, 1), of_words_(*device_, 2) {}

void VulkanRefinement::record(ks::Commands& commands, const MatchBuffers& buffers, const MatchArrays& arrays, uint32_t pairs) const {
  RefinePush push{};
  push.left_image = arrays.left & ~uint64_t{3};
  push.right_image = arrays.right & ~uint64_t{3};
  push.left_byte = arrays.left & 3;
  push.right_byte = arrays.right & 3;
  push.image_pitch = arrays.pitch(plan_);
  push.image_stride = arrays.stride(plan_);
  push.filtered = buffers.filtered->address();
  push.cells = buffers.cells->address();
  push.evidence = buffers.sums[0]->address();  // which the winners have read
  push.disparity = buffers.refined(arrays);
  push.width = plan_.width;
  push.height = plan_.height;
  push.left_bits = parameters_.left_bits;
  push.right_bits = parameters_.right_bits;
  push.min_disparity = parameters_.min_disparity;
  push.invalid = parameters_.invalid_disparity();
  const Passes& passes = arrays.element_bytes == 1 ? of_bytes_ : of_words_;
  const uint32_t columns = groups_of(plan_.width, REFINE_CELL), rows = groups_of(plan_.height, REFINE_CELL);
  commands.dispatch(passes.cells, push, columns, rows, pairs);
  commands.dispatch(passes.move, push, columns, rows, pairs);
  commands.dispatch(passes.windows, push, columns, rows, pairs);
}

}  // namespace simsense
