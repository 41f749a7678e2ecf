// SPDX-License-Identifier: Apache-2.0
// The matcher in Vulkan compute: the bits of the scalar reference, a whole batch per call, images and disparities in device memory. Any
// device that this project runs on and whose subgroups can shuffle; meant for GPUs (on a CPU device the CPU matcher is many times faster).
// Thread rule: externally synchronised.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "device/compute.h"
#include "match/matcher.h"
#include "vulkan/match_arrays.h"
#include "vulkan/match_steps.h"

namespace simsense {

/// Packed images [batch][height][width] in a buffer.
struct DeviceImages {
  const ks::Buffer& buffer;
  uint64_t offset_bytes = 0;
};

class VulkanMatcher final : public MatchStages {
 public:
  VulkanMatcher(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height, uint32_t batch, const MatchParameters& parameters,
                const MatchTuning& tuning);
  VulkanMatcher(const VulkanMatcher&) = delete;
  VulkanMatcher& operator=(const VulkanMatcher&) = delete;

  /// Matches, and returns when the result can be read. left, right: 8 bit. disparity: 32-bit float, pixels, -1 = invalid, at a multiple of
  /// 4 bytes.
  void match(const DeviceImages& left, const DeviceImages& right, const DeviceImages& disparity);
  /// Records match() of at most plan().pairs_at_once pairs as a part of other work.
  void record(ks::Commands& commands, const MatchArrays& arrays, uint32_t pairs);
  /// Sets the commands and arrays that the following stages record into.
  void begin(ks::Commands& commands, const MatchArrays& arrays, uint32_t pairs);
  void census() override;
  void cost() override;
  void sgm() override;
  void winner() override;
  void checks() override;
  void refine() override;
  void detection() override;
  [[nodiscard]] bool stores_costs() const override { return plan_.stored_costs; }
  [[nodiscard]] bool refines() const override { return parameters_.refines(); }
  [[nodiscard]] bool detects() const override { return parameters_.detects(); }

  /// Milliseconds of each stage of the last call, on the device.
  [[nodiscard]] std::vector<ks_stage_time> stage_times() const;
  /// Bytes of device memory that this matcher holds.
  [[nodiscard]] uint64_t memory_bytes() const { return buffers_.memory_bytes; }
  [[nodiscard]] const MatchPlan& plan() const { return plan_; }

 private:
  std::shared_ptr<ks::Device> device_;
  uint32_t batch_;
  MatchParameters parameters_;
  MatchPlan plan_;
  MatchBuffers buffers_;
  VulkanStep step_;
  VulkanCensus census_;
  std::optional<VulkanBlockCost> cost_;
  VulkanSgm sgm_;
  VulkanWinner winner_;
  VulkanMedian median_;
  std::optional<VulkanRefinement> refinement_;
  std::optional<VulkanDetection> detection_;
  ks::Commands own_commands_;  // of match()
  ks::Commands* commands_ = nullptr;
  MatchArrays arrays_;
  uint32_t pairs_ = 0;
};

std::vector<ks_stage_time> to_stage_times(const std::vector<std::pair<std::string, double>>& times);

/// Returns why the Vulkan matcher cannot run on the device with these sizes and parameters; empty if it can.
std::string why_not_vulkan(const ks::Device& device, uint32_t width, uint32_t height, uint32_t batch, const MatchParameters& parameters);

/// Makes the matcher. Throws KS_ERROR_UNSUPPORTED with the reason of why_not_vulkan().
std::unique_ptr<VulkanMatcher> make_vulkan_matcher(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height, uint32_t batch,
                                                   const MatchParameters& parameters, const MatchTuning& tuning = {});

/// Makes the Vulkan matcher behind the interface for host images.
std::unique_ptr<Matcher> make_vulkan_host_matcher(const std::shared_ptr<ks::Device>& device, uint32_t width, uint32_t height,
                                                  const MatchParameters& parameters, const MatchTuning& tuning = {});

}  // namespace simsense
