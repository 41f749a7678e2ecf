// Depth, registration and points in Vulkan compute: the arithmetic of depth/, to the device's rounding of a quotient. Disparities in device
// memory, outputs wherever and however the caller wants them. Thread rule: externally synchronised.
#pragma once

#include <memory>
#include <optional>

#include "depth/depth.h"
#include "depth/points.h"
#include "depth/registration.h"
#include "device/compute.h"
#include "shared/depth_push.h"

namespace simsense {

struct DepthRequest {
  float invalid_disparity = -1;
  DepthRange range;
  uint32_t splat_size = 1;
};

class VulkanDepth {
 public:
  /// registration: nullptr without an RGB camera; points belong to the RGB camera where there is one.
  VulkanDepth(std::shared_ptr<ks::Device> device, const simsense_rig_desc& rig, const StereoGeometry& geometry,
              const Registration* registration, const PointMaker& points);

  /// Once per submission, before the other two.
  void begin(ks::Commands& commands, const DepthRequest& request);
  /// disparity: address of [pairs][height][width] floats. Any of the images may be absent.
  void record_left(ks::Commands& commands, uint64_t disparity, const ImageRef& disparity_out, const ImageRef& depth, const ImageRef& points,
                   uint32_t pairs) const;
  void record_rgb(ks::Commands& commands, uint64_t disparity, const ImageRef& depth, const ImageRef& points, const ImageRef& colored,
                  const ImageRef& rgb, uint32_t pairs);
  /// Address of the parameters, for other stages that need depths.
  [[nodiscard]] uint64_t block() const { return block_->address(); }
  [[nodiscard]] uint64_t memory_bytes() const { return nearest_ ? nearest_->size_bytes() : 0; }

 private:
  std::shared_ptr<ks::Device> device_;
  DepthParameters parameters_{};
  std::shared_ptr<ks::Buffer> block_, ray_x_, ray_y_, row_starts_, nearest_;
  ks::ComputePipeline depth_;
  std::optional<ks::ComputePipeline> splat_, resolve_;
};

}  // namespace simsense
