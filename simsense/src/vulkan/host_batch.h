// A batch of host images for the Vulkan matcher, through host-visible buffers. Thread rule: externally synchronised.
#pragma once

#include <memory>
#include <vector>

#include "vulkan/vulkan_matcher.h"

namespace simsense {

class VulkanHostBatch {
 public:
  VulkanHostBatch(const std::shared_ptr<ks::Device>& device, uint32_t width, uint32_t height, uint32_t batch,
                  const MatchParameters& parameters, const MatchTuning& tuning = {});
  /// Copies pair n in; 8-bit images.
  void put(uint32_t n, ConstImage left, ConstImage right);
  /// All pairs.
  void match() { matcher_->match({*left_}, {*right_}, {*disparity_}); }
  /// [height][width] of pair n, until the next match; may be written to.
  [[nodiscard]] float* disparity(uint32_t n) const { return static_cast<float*>(disparity_->mapped()) + n * width_ * height_; }
  [[nodiscard]] std::vector<ks_stage_time> stage_times() const { return matcher_->stage_times(); }

 private:
  size_t width_, height_;
  std::unique_ptr<VulkanMatcher> matcher_;
  std::shared_ptr<ks::Buffer> left_, right_, disparity_;
};

}  // namespace simsense
