// SPDX-License-Identifier: Apache-2.0
// Rectification in Vulkan compute, bit for bit that of cpu/rectify/remap.h. The tables are uploaded once. Thread rule: externally
// synchronised.
#pragma once

#include "device/compute.h"
#include "rectify/rectification.h"
#include "shared/remap_push.h"

namespace simsense {

class VulkanRemap {
 public:
  /// rectification must have tables.
  VulkanRemap(const std::shared_ptr<ks::Device>& device, const Rectification& rectification);

  /// Records the resampling of one side's images. target and copy get the same counts; either may be absent.
  void record(ks::Commands& commands, uint32_t side, bool nearest, const ImageRef& source, const ImageRef& target, const ImageRef& copy,
              uint32_t pairs) const;
  /// Source coordinates of each rectified left pixel: addresses of [height][width] floats.
  [[nodiscard]] uint64_t left_x() const { return tables_[0].x->address(); }
  [[nodiscard]] uint64_t left_y() const { return tables_[0].y->address(); }

 private:
  struct Table {
    std::shared_ptr<ks::Buffer> x, y;
  };
  uint32_t width_, height_;
  Table tables_[2];
  ks::ComputePipeline remap_;
};

}  // namespace simsense
