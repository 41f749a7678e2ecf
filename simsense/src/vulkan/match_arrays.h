// SPDX-License-Identifier: Apache-2.0
// The arrays that the matcher's stages on the device share, and the places of a call's images and maps. Plain values, laid out by a
// MatchPlan.
#pragma once

#include <memory>

#include "device/buffer.h"
#include "shared/detection_push.h"
#include "vulkan/plan.h"

namespace simsense {

/// Device addresses of the arrays of one pass through the stages, [pairs][height][width].
struct MatchArrays {
  uint64_t left = 0, right = 0;                // at a multiple of element_bytes
  uint32_t element_bytes = 1;                  // 1 or 2 per pixel
  uint32_t image_pitch = 0, image_stride = 0;  // pixels from row to row, from image to image; 0 = packed
  uint64_t disparity = 0;                      // 32-bit float, packed
  uint64_t confidence = 0, reason = 0;         // 32-bit float, MatchReason; 0 = not wanted
  DetectionNoise noise{0, 0, 0, 1};            // of the images

  [[nodiscard]] uint32_t pitch(const MatchPlan& plan) const { return image_pitch ? image_pitch : plan.width; }
  [[nodiscard]] uint32_t stride(const MatchPlan& plan) const { return image_stride ? image_stride : plan.width * plan.height; }
  /// The maps that are present, as MAPS_*.
  [[nodiscard]] uint32_t maps() const { return (confidence ? MAPS_CONFIDENCE : 0u) | (reason ? MAPS_REASON : 0u); }
};

/// The matcher's own arrays, as match_push.h, refine_push.h and detection_push.h describe them. gray, cost, filtered, cells, high and
/// energy exist only if needed.
struct MatchBuffers {
  MatchBuffers(const std::shared_ptr<ks::Device>& device, const MatchPlan& plan, const MatchParameters& parameters);
  std::shared_ptr<ks::Buffer> left_census, right_census, gray, cost, sums[4], right_winner, unchecked, filtered, cells, high, energy;
  uint64_t memory_bytes = 0;

  /// Address of the disparities after the median.
  [[nodiscard]] uint64_t after_median(const MatchArrays& arrays) const { return filtered ? filtered->address() : arrays.disparity; }
  /// Address of the disparities after the refinement. It reuses the array of unchecked ones, which are no longer needed.
  [[nodiscard]] uint64_t refined(const MatchArrays& arrays) const {
    if (!high) return arrays.disparity;
    return cells ? unchecked->address() : filtered->address();
  }
};

/// The arrays that the cost and path stages share.
PathPush path_push(const MatchPlan& plan, const MatchParameters& parameters, const MatchBuffers& buffers);

}  // namespace simsense
