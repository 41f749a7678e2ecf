// SPDX-License-Identifier: Apache-2.0
// No measurement beside a step of disparity or at the right image's edges, in Vulkan compute: the bits of cpu/checks/edges.h.
// Thread rule: externally synchronised.
#pragma once

#include <memory>

#include "checks/edges.h"
#include "device/compute.h"
#include "vulkan/checks/clean.h"

namespace simsense {

class VulkanEdges {
 public:
  explicit VulkanEdges(std::shared_ptr<ks::Device> device);
  /// push: clean_push() of the pairs' maps.
  void record(ks::Commands& commands, CleanPush push, const EdgeParameters& parameters, uint32_t pairs);
  [[nodiscard]] uint64_t memory_bytes() const { return marks_ ? marks_->size_bytes() : 0; }

 private:
  std::shared_ptr<ks::Device> device_;
  ks::ComputePipeline pipeline_;
  std::shared_ptr<ks::Buffer> marks_;
};

}  // namespace simsense
