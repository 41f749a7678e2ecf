// SPDX-License-Identifier: Apache-2.0
// Hamming costs summed over a block, into a volume, in Vulkan compute; only where plan.stored_costs.
#pragma once

#include "device/compute.h"
#include "vulkan/match_arrays.h"

namespace simsense {

class VulkanBlockCost {
 public:
  /// plan and parameters must outlive this.
  VulkanBlockCost(const std::shared_ptr<ks::Device>& device, const MatchPlan& plan, const MatchParameters& parameters);
  void record(ks::Commands& commands, const MatchBuffers& buffers, uint32_t pairs) const;

 private:
  const MatchPlan& plan_;
  const MatchParameters& parameters_;
  ks::ComputePipeline pipeline_;
};

}  // namespace simsense
