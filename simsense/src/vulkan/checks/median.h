// SPDX-License-Identifier: Apache-2.0
// Left-right check and median of the matcher's disparities, with the resulting changes of the other maps, in Vulkan compute.
#pragma once

#include "device/compute.h"
#include "vulkan/match_arrays.h"

namespace simsense {

class VulkanMedian {
 public:
  /// plan and parameters must outlive this.
  VulkanMedian(const std::shared_ptr<ks::Device>& device, const MatchPlan& plan, const MatchParameters& parameters);
  void record(ks::Commands& commands, const MatchBuffers& buffers, const MatchArrays& arrays, uint32_t pairs) const;

 private:
  const MatchPlan& plan_;
  const MatchParameters& parameters_;
  ks::ComputePipeline pipeline_;
};

}  // namespace simsense
