// SPDX-License-Identifier: Apache-2.0
// The speckle filter in Vulkan compute: the bits of cpu/checks/speckle.h. Thread rule: externally synchronised.
#pragma once

#include <memory>

#include "device/compute.h"
#include "vulkan/checks/clean.h"

namespace simsense {

class VulkanSpeckleFilter {
 public:
  explicit VulkanSpeckleFilter(std::shared_ptr<ks::Device> device);
  /// push: clean_push() of the pairs' maps.
  void record(ks::Commands& commands, CleanPush push, uint32_t pairs);
  [[nodiscard]] uint64_t memory_bytes() const { return (parent_ ? parent_->size_bytes() : 0) + (size_ ? size_->size_bytes() : 0); }

 private:
  std::shared_ptr<ks::Device> device_;
  ks::ComputePipeline pipeline_;
  std::shared_ptr<ks::Buffer> parent_, size_;  // union-find of islands
};

}  // namespace simsense
