// SPDX-License-Identifier: Apache-2.0
// Winners of the left and the right image, uniqueness, subpixel step and confidence, in Vulkan compute.
#pragma once

#include "device/compute.h"
#include "vulkan/match_arrays.h"

namespace simsense {

class VulkanWinner {
 public:
  /// plan and parameters must outlive this.
  VulkanWinner(const std::shared_ptr<ks::Device>& device, const MatchPlan& plan, const MatchParameters& parameters);
  void record(ks::Commands& commands, const MatchBuffers& buffers, const MatchArrays& arrays, uint32_t pairs) const;

 private:
  const MatchPlan& plan_;
  const MatchParameters& parameters_;
  ks::ComputePipeline pipeline_;
};

}  // namespace simsense
