// SPDX-License-Identifier: Apache-2.0
#include "vulkan/match_steps.h"

#include "match/detection.h"
#include "spirv/detection.h"
#include "spirv/detection_bare.h"
#include "spirv/high_pass.h"
#include "vulkan/dispatch.h"
#include "vulkan/plan.h"

namespace simsense {

VulkanDetection::VulkanDetection(const VulkanStep& step)
    : VulkanStep(step),
      of_bytes_(*device_, high_pass_spirv, sizeof(HighPassPush), Constants{1u}),
      of_words_(*device_, high_pass_spirv, sizeof(HighPassPush), Constants{2u}),
      detection_(*device_, detection_spirv, sizeof(DetectionPush)),
      bare_(*device_, detection_bare_spirv, sizeof(DetectionPush)) {}

void VulkanDetection::record(ks::Commands& commands, const MatchBuffers& buffers, const MatchArrays& arrays, uint32_t pairs) const {
  const uint32_t columns = groups_of(plan_.width, DETECTION_GROUP), rows = groups_of(plan_.height, DETECTION_GROUP);
  HighPassPush high{};
  high.image_pitch = arrays.pitch(plan_);
  high.image_stride = arrays.stride(plan_);
  high.width = plan_.width;
  high.height = plan_.height;
  high.mean_side = detection_mean_side(parameters_.detection_side());
  high.part = detection_part(high.mean_side);
  high.high = buffers.high->address();
  high.energy = buffers.energy->address();
  high.noise = arrays.noise;
  high.found = buffers.refined(arrays);
  high.invalid = parameters_.invalid_disparity();
  for (const bool is_left : {false, true}) {
    const uint64_t image = is_left ? arrays.left : arrays.right;
    high.image = image & ~uint64_t{3};
    high.first_byte = image & 3;
    high.bits = is_left ? parameters_.left_bits : parameters_.right_bits;
    high.is_left = is_left ? 1 : 0;
    commands.dispatch(arrays.element_bytes == 1 ? of_bytes_ : of_words_, high, columns, rows, pairs);
  }
  DetectionPush push{};
  push.energy = buffers.energy->address();
  push.found = buffers.refined(arrays);
  push.bare = buffers.right_winner->address();  // which the left-right check has read
  push.disparity = arrays.disparity;
  push.confidence = arrays.confidence;
  push.reason = arrays.reason;
  push.width = plan_.width;
  push.height = plan_.height;
  const uint32_t side = parameters_.detection_side();
  push.reach = static_cast<int>(side / 2);
  push.bare_reach = detection_bare_reach(side);
  push.most_matched = static_cast<int>(detection_most_matched(side));
  push.least = parameters_.min_detection_sigma;
  push.invalid = parameters_.invalid_disparity();
  push.maps = arrays.maps();
  commands.dispatch(detection_, push, columns, rows, pairs);
  commands.dispatch(bare_, push, columns, rows, pairs);
}

}  // namespace simsense
