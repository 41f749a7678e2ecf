// SPDX-License-Identifier: Apache-2.0
// The check that both images show the same (match/correlation.h), in Vulkan compute.
#pragma once

#include "device/compute.h"
#include "vulkan/match_arrays.h"

namespace simsense {

class VulkanCorrelation {
 public:
  /// plan, parameters: outlive this.
  VulkanCorrelation(const std::shared_ptr<ks::Device>& device, const MatchPlan& plan, const MatchParameters& parameters);
  void record(ks::Commands& commands, const MatchBuffers& buffers, const MatchArrays& arrays, uint32_t pairs) const;

 private:
  const MatchPlan& plan_;
  const MatchParameters& parameters_;
  ks::ComputePipeline of_bytes_, of_words_, correlation_, bare_;
};

}  // namespace simsense
