// SPDX-License-Identifier: Apache-2.0
// Why pixels have no depth, in Vulkan compute: the bits of cpu/checks/reason.h, and the reason out_of_range.
#pragma once

#include "device/compute.h"
#include "shared/map_push.h"
#include "stages/settings.h"
#include "vulkan/maps.h"

namespace simsense {

class VulkanReason {
 public:
  explicit VulkanReason(const std::shared_ptr<ks::Device>& device);
  /// depth_block: VulkanDepth::block(). left: what the matcher saw.
  void record(ks::Commands& commands, const StageSettings& settings, uint64_t depth_block, const ImageRef& left, const DeviceMaps& maps,
              uint32_t width, uint32_t height, uint32_t pairs) const;

 private:
  ks::ComputePipeline pipeline_;
};

}  // namespace simsense
