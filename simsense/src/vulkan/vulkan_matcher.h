// The matcher in Vulkan compute: the bits of the scalar reference, a whole batch per call, images and disparities in device memory. Any
// device that this project runs on and whose subgroups can shuffle; meant for GPUs (on a CPU device the CPU matcher is many times faster).
// Thread rule: externally synchronised.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "device/compute.h"
#include "matcher.h"
#include "vulkan/plan.h"

namespace simsense {

/// Packed images [batch][height][width] inside a buffer.
struct DeviceImages {
  const ks::Buffer& buffer;
  uint64_t offset_bytes = 0;
};

/// Arrays of one pass through the stages, by device address: [pairs][height][width].
struct MatchArrays {
  uint64_t left = 0, right = 0;                // at a multiple of element_bytes
  uint32_t element_bytes = 1;                  // 1 or 2 per pixel
  uint32_t image_pitch = 0, image_stride = 0;  // pixels from row to row, from image to image; 0 = packed
  uint64_t disparity = 0;                      // 32-bit float, packed
  uint64_t confidence = 0, reason = 0;         // 32-bit float, MatchReason; 0 = not wanted
};

class VulkanMatcher {
 public:
  VulkanMatcher(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height, uint32_t batch, const MatchParameters& parameters,
                const MatchTuning& tuning);
  ~VulkanMatcher();
  VulkanMatcher(const VulkanMatcher&) = delete;
  VulkanMatcher& operator=(const VulkanMatcher&) = delete;

  /// left, right: 8 bit; disparity: 32-bit float, pixels, -1 = invalid, at a multiple of 4 bytes. Returns when it can be read.
  void match(const DeviceImages& left, const DeviceImages& right, const DeviceImages& disparity);
  /// The same as part of other work, for at most plan().pairs_at_once pairs.
  void record(ks::Commands& commands, const MatchArrays& arrays, uint32_t pairs);
  /// Milliseconds of each stage of the last call, on the device.
  [[nodiscard]] std::vector<ks_stage_time> stage_times() const;
  /// Device memory that this matcher holds.
  [[nodiscard]] uint64_t memory_bytes() const;
  [[nodiscard]] const MatchPlan& plan() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

std::vector<ks_stage_time> to_stage_times(const std::vector<std::pair<std::string, double>>& times);

/// Why the Vulkan matcher cannot do this on the device; empty where it can.
std::string why_not_vulkan(const ks::Device& device, uint32_t width, uint32_t height, uint32_t batch, const MatchParameters& parameters);

/// Throws KS_ERROR_UNSUPPORTED with that reason.
std::unique_ptr<VulkanMatcher> make_vulkan_matcher(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height, uint32_t batch,
                                                   const MatchParameters& parameters, const MatchTuning& tuning = {});

/// The same behind the interface of host images.
std::unique_ptr<Matcher> make_vulkan_host_matcher(const std::shared_ptr<ks::Device>& device, uint32_t width, uint32_t height,
                                                  const MatchParameters& parameters, const MatchTuning& tuning = {});

}  // namespace simsense
