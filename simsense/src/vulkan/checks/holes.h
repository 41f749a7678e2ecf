// SPDX-License-Identifier: Apache-2.0
// Filling of holes in Vulkan compute: the bits of cpu/checks/holes.h. Thread rule: externally synchronised.
#pragma once

#include <memory>

#include "device/compute.h"
#include "vulkan/checks/clean.h"

namespace simsense {

class VulkanHoleFilling {
 public:
  explicit VulkanHoleFilling(std::shared_ptr<ks::Device> device);
  /// push: clean_push() of the pairs' maps.
  void record(ks::Commands& commands, CleanPush push, uint32_t pairs);
  [[nodiscard]] uint64_t memory_bytes() const { return guesses_ ? guesses_->size_bytes() : 0; }

 private:
  std::shared_ptr<ks::Device> device_;
  ks::ComputePipeline pipeline_;
  std::shared_ptr<ks::Buffer> guesses_;
};

}  // namespace simsense
