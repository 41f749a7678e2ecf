// The whole engine in Vulkan compute: signal, rectification, matcher, cleaning, depth, registration and points of a batch in one
// submission, on the caller's device buffers; no image passes through the host unless the caller's lies there. Submissions overlap with the
// host's work, two at a time. Thread rule: externally synchronised.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "depth/registration.h"
#include "device/timeline.h"
#include "vulkan/cleaner.h"
#include "vulkan/depth.h"
#include "vulkan/eyes.h"
#include "vulkan/maps.h"

namespace simsense {

/// What an engine is made of; outlives the pipeline.
struct PipelineParts {
  const simsense_rig_desc& rig;
  const Rectification& rectification;
  const Registration* registration;  // nullptr without an RGB camera
  const PointMaker& points;
};

/// What may differ from call to call.
struct PipelineSettings {
  const simsense_parameters& parameters;
  const Imager (&imagers)[2];
  bool wide;  // the matcher sees 16 bit
  Matching matching;
  ks_progress_fn progress;  // called while the work is recorded; may be nullptr
  void* progress_user;
};

class VulkanPipeline {
 public:
  VulkanPipeline(std::shared_ptr<ks::Device> device, const PipelineParts& parts);
  ~VulkanPipeline();
  VulkanPipeline(const VulkanPipeline&) = delete;
  VulkanPipeline& operator=(const VulkanPipeline&) = delete;

  [[nodiscard]] HostStaging& staging() { return staging_; }
  /// Loads host inputs, records and submits. Returns the submission's number, from 1 on.
  uint64_t submit(DeviceFrame frame, const PipelineSettings& settings);
  /// Until that submission has run, and its host outputs are written.
  void wait(uint64_t submission);
  void wait_idle() { wait(submitted_); }
  [[nodiscard]] uint64_t submitted() const { return submitted_; }
  /// nullptr where the device has none: a submission has run when submit() returns.
  [[nodiscard]] const ks::Timeline* timeline() const { return timeline_ ? &*timeline_ : nullptr; }
  /// Of the submission waited for last, on the device.
  [[nodiscard]] const std::vector<std::pair<std::string, double>>& stage_times() const { return stage_times_; }
  /// Device memory beside the caller's and the tables.
  [[nodiscard]] uint64_t memory_bytes() const;

 private:
  struct Slot {
    explicit Slot(const std::shared_ptr<ks::Device>& device) : commands(device) {}
    ks::Commands commands;
    std::optional<DeviceFrame> frame;  // keeps the caller's buffers while they are used
    uint64_t number = 0;               // 0 = nothing under way
  };
  void record(ks::Commands& commands, const DeviceFrame& frame, const PipelineSettings& settings);
  void record_pairs(ks::Commands& commands, const DeviceFrame& frame, const Pairs& pairs, const PipelineSettings& settings);
  void record_disparity(ks::Commands& commands, const DeviceFrame& frame, const Pairs& pairs, const PipelineSettings& settings,
                        const ImageRef (&images)[2]);
  void record_outputs(ks::Commands& commands, const DeviceFrame& frame, const Pairs& pairs, const DeviceMaps& maps);
  void finish(Slot& slot);
  [[nodiscard]] uint32_t pairs_at_once() const;

  std::shared_ptr<ks::Device> device_;
  const simsense_rig_desc& rig_;
  bool has_rgb_;
  std::unique_ptr<VulkanRectifier> rectifier_;
  VulkanEyes eyes_;
  VulkanCleaner cleaner_;
  std::optional<VulkanDepth> depth_;
  std::unique_ptr<VulkanMaps> maps_;  // made when first needed, as depth_
  const PipelineParts parts_;
  Matching matching_;
  HostStaging staging_;
  std::optional<ks::Timeline> timeline_;
  std::vector<std::unique_ptr<Slot>> slots_;
  uint64_t submitted_ = 0;
  uint64_t recorded_outputs_ = 0;  // which ones the last submission had
  std::vector<std::pair<std::string, double>> stage_times_;
};

/// Why the device cannot run the pipeline; empty where it can.
std::string why_no_pipeline(const ks::Device& device, const simsense_rig_desc& rig);

}  // namespace simsense
