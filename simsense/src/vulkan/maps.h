// The matcher and its maps in Vulkan compute: where each map of some pairs lies (the caller's memory where it is packed, else an array of
// ours that is copied there), the region of interest, and reasons. Thread rule: externally synchronised.
#pragma once

#include <memory>
#include <optional>

#include "disparity/holes.h"
#include "frame.h"
#include "shared/map_push.h"
#include "vulkan/cleaner.h"
#include "vulkan/eyes.h"
#include "vulkan/vulkan_matcher.h"

namespace simsense {

/// What is matched, and how.
struct Matching {
  MatchParameters parameters;
  Region wanted, used;  // the region of interest, and what must be matched to find its disparities
  bool low_memory = false;
  bool operator==(const Matching&) const = default;
};

struct ExplainRequest {
  uint64_t depth_block = 0;  // VulkanDepth::block()
  uint32_t window_width = 7, window_height = 7, low_texture_dn = 0, saturated_dn = 255;
};

class VulkanMaps {
 public:
  VulkanMaps(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height, uint32_t batch, const Matching& matching);

  [[nodiscard]] uint32_t pairs_at_once() const { return std::min(matcher_->plan().pairs_at_once, signal_pairs); }
  /// Where the maps of those pairs are made; disparity always.
  DeviceMaps open(const DeviceFrame& frame, const Pairs& pairs);
  /// Whether the disparities are made where the caller wants them.
  [[nodiscard]] static bool is_in_place(const DeviceFrame& frame);
  /// images: packed, both of one format.
  void record_match(ks::Commands& commands, const ImageRef (&images)[2], const DeviceMaps& maps, uint32_t pairs);
  /// After everything else: reasons of the image and of the depth.
  void record_explanation(ks::Commands& commands, const ExplainRequest& request, const ImageRef& left, const DeviceMaps& maps,
                          uint32_t pairs);
  /// Confidence and reasons to the caller, where they are not made there.
  void record_copies(ks::Commands& commands, const DeviceFrame& frame, const Pairs& pairs, const DeviceMaps& maps);
  [[nodiscard]] uint64_t memory_bytes() const;

 private:
  uint64_t reserve(std::shared_ptr<ks::Buffer>& buffer, uint64_t pixel_bytes, uint32_t width, uint32_t height);
  MatchArrays match_arrays(const ImageRef (&images)[2], const DeviceMaps& maps);
  void place(ks::Commands& commands, const MatchArrays& part, const DeviceMaps& maps, uint32_t pairs);
  [[nodiscard]] bool is_partial() const { return !(matching_.used == whole_) || !(matching_.wanted == whole_); }

  std::shared_ptr<ks::Device> device_;
  uint32_t width_, height_;
  Region whole_;
  Matching matching_;
  std::unique_ptr<VulkanMatcher> matcher_;
  std::optional<ks::ComputePipeline> place_, explain_, copy_;  // made when first needed
  std::shared_ptr<ks::Buffer> disparity_, confidence_, reason_, part_disparity_, part_confidence_, part_reason_;
};

}  // namespace simsense
