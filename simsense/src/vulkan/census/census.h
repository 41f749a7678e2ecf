// SPDX-License-Identifier: Apache-2.0
// The census of both images of some pairs, in Vulkan compute: the words of cpu/census, both images' and the right one's shifted copies.
#pragma once

#include <optional>

#include "device/compute.h"
#include "vulkan/match_arrays.h"

namespace simsense {

class VulkanCensus {
 public:
  /// plan and parameters must outlive this.
  VulkanCensus(const std::shared_ptr<ks::Device>& device, const MatchPlan& plan, const MatchParameters& parameters);
  void record(ks::Commands& commands, const MatchBuffers& buffers, const MatchArrays& arrays, uint32_t pairs);

 private:
  const ks::ComputePipeline& pipeline(uint32_t element_bytes);

  std::shared_ptr<ks::Device> device_;
  const MatchPlan& plan_;
  const MatchParameters& parameters_;
  ks::ComputePipeline of_bytes_;
  std::optional<ks::ComputePipeline> of_words_;  // of 16-bit images, made when first needed
};

}  // namespace simsense
