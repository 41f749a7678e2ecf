// SPDX-License-Identifier: Apache-2.0
// Registration, and the points of the RGB camera, in Vulkan compute: the arithmetic of cpu/registration, to the device's rounding of a
// quotient. Thread rule: externally synchronised.
#pragma once

#include <memory>

#include "vulkan/depth/depth.h"

namespace simsense {

class VulkanRegistration {
 public:
  /// For a rig with an RGB camera. depth: shares its parameters; must outlive this.
  VulkanRegistration(std::shared_ptr<ks::Device> device, const VulkanDepth& depth);

  /// Records the registration to the RGB camera. disparity: address of [pairs][height][width] floats. depth, points and colored may be
  /// absent.
  void record(ks::Commands& commands, uint64_t disparity, const ImageRef& depth, const ImageRef& points, const ImageRef& colored,
              const ImageRef& rgb, uint32_t pairs);
  [[nodiscard]] uint64_t memory_bytes() const { return nearest_ ? nearest_->size_bytes() : 0; }

 private:
  std::shared_ptr<ks::Device> device_;
  const VulkanDepth& depth_;
  ks::ComputePipeline splat_, resolve_;
  std::shared_ptr<ks::Buffer> nearest_;  // the z-buffer
};

}  // namespace simsense
