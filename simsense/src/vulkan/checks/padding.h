// SPDX-License-Identifier: Apache-2.0
// No disparity where a rectified pixel lies outside its source, in Vulkan compute: the bits of cpu/checks/padding.h.
#pragma once

#include "device/compute.h"
#include "vulkan/checks/clean.h"
#include "vulkan/rectify/remap.h"

namespace simsense {

class VulkanPadding {
 public:
  explicit VulkanPadding(const std::shared_ptr<ks::Device>& device);
  /// push: clean_push() of the pairs' maps.
  void record(ks::Commands& commands, CleanPush push, const VulkanRemap& remap, uint32_t pairs) const;

 private:
  ks::ComputePipeline pipeline_;
};

}  // namespace simsense
