// What follows the matcher on disparities, in Vulkan compute: padding of rectified images, speckle filter, hole filling. The bits of
// rectify/remap.h, disparity/speckle.h and disparity/holes.h. Thread rule: externally synchronised.
#pragma once

#include <memory>

#include "device/compute.h"
#include "disparity/holes.h"
#include "shared/clean_push.h"
#include "vulkan/rectifier.h"

namespace simsense {

/// Maps of the matcher on the device, [pairs][height][width] packed: addresses, 0 = absent.
struct DeviceMaps {
  uint64_t disparity = 0, confidence = 0, reason = 0;
};

struct CleanRequest {
  float invalid = -1;
  bool drop_padding = false;
  uint32_t speckle_max_size = 0;
  float speckle_max_diff_px = 1;
  HoleFilling filling = HoleFilling::none;
  Region region;  // whose holes are filled
};

class VulkanCleaner {
 public:
  /// rectifier: nullptr where the pair comes rectified; outlives this.
  VulkanCleaner(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height, const VulkanRectifier* rectifier)
      : device_(std::move(device)), width_(width), height_(height), rectifier_(rectifier) {}

  void record(ks::Commands& commands, const CleanRequest& request, const DeviceMaps& maps, uint32_t pairs);
  [[nodiscard]] uint64_t memory_bytes() const { return (parent_ ? parent_->size_bytes() : 0) + (size_ ? size_->size_bytes() : 0); }

 private:
  const ks::ComputePipeline& pipeline(std::unique_ptr<ks::ComputePipeline>& slot, std::span<const uint32_t> code);
  void record_padding(ks::Commands& commands, CleanPush push, uint32_t pairs);
  void record_speckle_filter(ks::Commands& commands, CleanPush push, uint32_t pairs);
  void record_hole_filling(ks::Commands& commands, CleanPush push, uint32_t pairs);

  std::shared_ptr<ks::Device> device_;
  uint32_t width_, height_;
  const VulkanRectifier* rectifier_;
  std::unique_ptr<ks::ComputePipeline> padding_, islands_, holes_;  // made when first needed
  std::shared_ptr<ks::Buffer> parent_, size_;
};

}  // namespace simsense
