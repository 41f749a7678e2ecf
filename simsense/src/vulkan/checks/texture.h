// SPDX-License-Identifier: Apache-2.0
// No measurement where the left image shows nothing, in Vulkan compute: the bits of cpu/checks/texture.h.
// Thread rule: externally synchronised.
#pragma once

#include <memory>

#include "device/compute.h"
#include "shared/map_push.h"
#include "stages/settings.h"
#include "vulkan/maps.h"

namespace simsense {

class VulkanTexture {
 public:
  explicit VulkanTexture(std::shared_ptr<ks::Device> device);
  /// left: what the matcher saw.
  void record(ks::Commands& commands, const StageSettings& settings, const ImageRef& left, const DeviceMaps& maps, uint32_t width,
              uint32_t height, uint32_t pairs);
  [[nodiscard]] uint64_t memory_bytes() const { return blank_ ? blank_->size_bytes() : 0; }

 private:
  std::shared_ptr<ks::Device> device_;
  ks::ComputePipeline pipeline_;
  std::shared_ptr<ks::Buffer> blank_;
};

}  // namespace simsense
