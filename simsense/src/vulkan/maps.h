// SPDX-License-Identifier: Apache-2.0
// Where each of the matcher's maps of some pairs lies on the device: in the caller's memory where it is packed, else in an array of ours
// that is copied there; and the maps of the part that is matched for a region of interest. Thread rule: externally synchronised.
#pragma once

#include <memory>
#include <optional>

#include "device/compute.h"
#include "shared/choices.h"
#include "stages/settings.h"
#include "vulkan/frame.h"
#include "vulkan/match_arrays.h"

namespace simsense {

/// Addresses of packed maps, [pairs][height][width]; 0 = absent.
struct DeviceMaps {
  uint64_t disparity = 0, confidence = 0, reason = 0;
  /// The maps that are present, as MAPS_*.
  [[nodiscard]] uint32_t flags() const { return (confidence ? MAPS_CONFIDENCE : 0u) | (reason ? MAPS_REASON : 0u); }
};

class VulkanMaps {
 public:
  /// pairs_at_once: the most pairs of later calls.
  VulkanMaps(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height, const StageSettings& settings, uint32_t pairs_at_once);

  /// Returns the maps of these pairs; the disparity is always there.
  DeviceMaps open(const DeviceFrame& frame, const Pairs& pairs);
  /// Whether the matcher writes disparities directly to the caller's image.
  [[nodiscard]] static bool is_in_place(const DeviceFrame& frame);
  /// The matcher's inputs and outputs: the maps, or for a region of interest those of the matched part. images: packed, both of one format.
  MatchArrays match_arrays(const ImageRef (&images)[2], const DeviceMaps& maps);
  /// Copies the matched part's maps, as match_arrays() gave them, into the whole image's.
  void place(ks::Commands& commands, const MatchArrays& part, const DeviceMaps& maps, uint32_t pairs);
  /// Copies confidence and reasons to the caller's images, unless they were written there.
  void store(ks::Commands& commands, const DeviceFrame& frame, const Pairs& pairs, const DeviceMaps& maps);
  [[nodiscard]] uint64_t memory_bytes() const;

 private:
  uint64_t address_in(std::shared_ptr<ks::Buffer>& buffer, uint64_t pixel_bytes, uint32_t width, uint32_t height);

  std::shared_ptr<ks::Device> device_;
  uint32_t width_, height_;
  Region wanted_, used_;
  bool is_partial_;
  float invalid_;
  uint32_t pairs_at_once_;
  std::optional<ks::ComputePipeline> place_, copy_;  // made when first needed
  std::shared_ptr<ks::Buffer> disparity_, confidence_, reason_, part_disparity_, part_confidence_, part_reason_;
};

}  // namespace simsense
