// SPDX-License-Identifier: Apache-2.0
// Calls in Vulkan compute: all stages of a batch in one submission, on the caller's device buffers; no image passes through the host unless
// the caller's lies there. Submissions overlap with the host's work, two at a time. Thread rule: externally synchronised.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "device/timeline.h"
#include "stages/request.h"
#include "vulkan/stages.h"

namespace simsense {

class VulkanCalls {
 public:
  /// rig must outlive this.
  VulkanCalls(std::shared_ptr<ks::Device> device, const PreparedRig& rig);
  ~VulkanCalls();
  VulkanCalls(const VulkanCalls&) = delete;
  VulkanCalls& operator=(const VulkanCalls&) = delete;

  /// Copies host inputs to the device, records and submits a call. Returns the submission's number, from 1 on.
  uint64_t submit(const ComputeRequest& request, const StageSettings& settings);
  /// Waits until a submission has run and its host outputs are written. Returns false if the timeout ended first (UINT64_MAX: no timeout).
  [[nodiscard]] bool wait(uint64_t submission, uint64_t timeout_ns);
  void wait_idle() { (void)wait(submitted_, UINT64_MAX); }
  [[nodiscard]] uint64_t submitted() const { return submitted_; }
  /// The timeline of submissions; nullptr if the device has none. submit() then returns after the work.
  [[nodiscard]] const ks::Timeline* timeline() const { return timeline_ ? &*timeline_ : nullptr; }
  /// Device times of the submission that was waited for last.
  [[nodiscard]] const std::vector<ks_stage_time>& stage_times() const { return stage_times_; }

 private:
  struct Slot {
    explicit Slot(const std::shared_ptr<ks::Device>& device) : commands(device) {}
    ks::Commands commands;
    std::optional<DeviceFrame> frame;  // keeps the caller's buffers while they are used
    ks::TimelinePoint wait;            // and what the work waits for
    uint64_t number = 0;               // 0 = nothing under way
  };
  DeviceFrame open(const ComputeRequest& request);
  void record(ks::Commands& commands, const DeviceFrame& frame, const ComputeRequest& request, const StageSettings& settings);
  void finish(Slot& slot);

  std::shared_ptr<ks::Device> device_;
  const PreparedRig& rig_;
  VulkanStages stages_;
  HostStaging staging_;
  std::optional<ks::Timeline> timeline_;
  std::vector<std::unique_ptr<Slot>> slots_;
  uint64_t submitted_ = 0;
  uint64_t recorded_outputs_ = 0;  // which ones the last submission had
  bool recorded_wide_ = false;
  std::vector<ks_stage_time> stage_times_;
};

/// Returns why the device cannot run this rig's calls with these parameters; empty if it can.
std::string why_no_vulkan_calls(const ks::Device& device, const simsense_rig_desc& rig, const MatchParameters& parameters);

}  // namespace simsense
