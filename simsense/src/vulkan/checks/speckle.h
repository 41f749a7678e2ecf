// SPDX-License-Identifier: Apache-2.0
// What follows the matcher on disparities, in Vulkan compute: padding of rectified images, speckle filter, hole filling. The bits of
// cpu/checks. Thread rule: externally synchronised.
#pragma once

#include <memory>
#include <span>

#include "device/compute.h"
#include "shared/clean_push.h"
#include "stages/settings.h"
#include "vulkan/maps.h"
#include "vulkan/rectify/rectifier.h"

namespace simsense {

class VulkanCleaner {
 public:
  VulkanCleaner(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height)
      : device_(std::move(device)), width_(width), height_(height) {}

  void drop_padding(ks::Commands& commands, const StageSettings& settings, const VulkanRectifier& rectifier, const DeviceMaps& maps,
                    uint32_t pairs);
  void filter_speckles(ks::Commands& commands, const StageSettings& settings, const DeviceMaps& maps, uint32_t pairs);
  void fill_holes(ks::Commands& commands, const StageSettings& settings, const DeviceMaps& maps, uint32_t pairs);
  [[nodiscard]] uint64_t memory_bytes() const { return (parent_ ? parent_->size_bytes() : 0) + (size_ ? size_->size_bytes() : 0); }

 private:
  const ks::ComputePipeline& pipeline(std::unique_ptr<ks::ComputePipeline>& slot, std::span<const uint32_t> code);
  [[nodiscard]] CleanPush push_of(const StageSettings& settings, const DeviceMaps& maps) const;
  [[nodiscard]] uint64_t word_bytes(uint32_t pairs) const { return uint64_t{width_} * height_ * pairs * sizeof(uint32_t); }

  std::shared_ptr<ks::Device> device_;
  uint32_t width_, height_;
  std::unique_ptr<ks::ComputePipeline> padding_, islands_, holes_;  // made when first needed
  std::shared_ptr<ks::Buffer> parent_, size_;
};

}  // namespace simsense
