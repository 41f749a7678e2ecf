// SPDX-License-Identifier: Apache-2.0
// Depth of the rectified left camera, and its points where the rig has no RGB camera, in Vulkan compute: the arithmetic of cpu/depth, to
// the device's rounding of a quotient. Disparities in device memory, outputs wherever and however the caller wants them. Thread rule:
// externally synchronised.
#pragma once

#include <memory>

#include "device/compute.h"
#include "shared/depth_push.h"
#include "stages/settings.h"

namespace simsense {

class VulkanDepth {
 public:
  VulkanDepth(std::shared_ptr<ks::Device> device, const PreparedRig& rig);

  /// Uploads the parameters of depth and registration; call once per submission, before either.
  void begin(ks::Commands& commands, const StageSettings& settings);
  /// Records the conversion of disparities to depth and points. disparity: address of [pairs][height][width] floats. Each image may be
  /// absent.
  void record(ks::Commands& commands, uint64_t disparity, const ImageRef& disparity_out, const ImageRef& depth, const ImageRef& points,
              uint32_t pairs) const;
  [[nodiscard]] const DepthParameters& parameters() const { return parameters_; }
  /// Address of the uploaded parameters, for other stages that need depths.
  [[nodiscard]] uint64_t block() const { return block_->address(); }

 private:
  std::shared_ptr<ks::Device> device_;
  DepthParameters parameters_{};
  std::shared_ptr<ks::Buffer> block_, ray_x_, ray_y_, row_starts_;
  ks::ComputePipeline pipeline_;
};

}  // namespace simsense
