// SPDX-License-Identifier: Apache-2.0
// The check that both images show more than noise (match/detection.h), in Vulkan compute.
#pragma once

#include "device/compute.h"
#include "vulkan/match_arrays.h"

namespace simsense {

class VulkanDetection {
 public:
  /// plan and parameters must outlive this.
  VulkanDetection(const std::shared_ptr<ks::Device>& device, const MatchPlan& plan, const MatchParameters& parameters);
  void record(ks::Commands& commands, const MatchBuffers& buffers, const MatchArrays& arrays, uint32_t pairs) const;

 private:
  const MatchPlan& plan_;
  const MatchParameters& parameters_;
  ks::ComputePipeline of_bytes_, of_words_, detection_, bare_;
};

}  // namespace simsense
