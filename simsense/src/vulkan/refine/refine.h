// SPDX-License-Identifier: Apache-2.0
// The refinement of disparities by the images' counts (match/refine.h), in Vulkan compute.
#pragma once

#include "device/compute.h"
#include "vulkan/match_arrays.h"

namespace simsense {

class VulkanRefinement {
 public:
  /// plan and parameters must outlive this.
  VulkanRefinement(const std::shared_ptr<ks::Device>& device, const MatchPlan& plan, const MatchParameters& parameters);
  void record(ks::Commands& commands, const MatchBuffers& buffers, const MatchArrays& arrays, uint32_t pairs) const;

 private:
  struct Passes {
    Passes(const std::shared_ptr<ks::Device>& device, uint32_t element_bytes);
    ks::ComputePipeline cells, windows;
  };
  const MatchPlan& plan_;
  const MatchParameters& parameters_;
  Passes of_bytes_, of_words_;
};

}  // namespace simsense
