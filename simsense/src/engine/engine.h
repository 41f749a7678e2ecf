// SPDX-License-Identifier: Apache-2.0
// The engine: a rig, the parameters in force and the imagers, and the calls that run on them, on the CPU or all of them on a GPU.
// Thread rule: externally synchronised; cancel() may be called by any thread at any time.
#pragma once

#include <atomic>
#include <memory>

#include "ks/sync.h"
#include "stages/request.h"

namespace simsense {

class CpuCalls;
class VulkanCalls;

class Engine {
 public:
  Engine(std::shared_ptr<ks::Device> device, const simsense_rig_desc& rig, const simsense_parameters& parameters);
  ~Engine();
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  /// Sets the parameters; if one is refused, the former ones stay.
  void set_parameters(const simsense_parameters& parameters);
  [[nodiscard]] const simsense_parameters& parameters() const { return parameters_; }
  void set_signal(const simsense_signal& left, const simsense_signal& right);
  [[nodiscard]] const simsense_signal& signal(uint32_t side) const { return imagers_[side].stated(); }
  [[nodiscard]] const StereoGeometry& geometry() const { return rig_.rectification.geometry; }
  [[nodiscard]] uint32_t batch_count() const { return rig_.rig.batch_count; }

  void compute(const ComputeRequest& request);
  /// Starts compute() and returns at once if possible: on a GPU, with all images in its buffers. wait() takes the result; the images must
  /// live until then.
  ks_sync submit(const ComputeRequest& request);
  /// Returns false if the work has not ended after timeout_ns (UINT64_MAX: no timeout).
  [[nodiscard]] bool wait(const ks_sync& sync, uint64_t timeout_ns);
  /// Ends a compute() that runs on the CPU or waits to be sent to a device.
  void cancel() { ++wishes_; }
  /// Returns the semaphore of submit()'s values, as an fd that the caller closes. Throws KS_ERROR_UNSUPPORTED if there is none.
  [[nodiscard]] ks_sync export_timeline();
  [[nodiscard]] const std::shared_ptr<ks::Device>& device() const { return device_; }
  /// The stage times of the last compute() or wait().
  [[nodiscard]] const std::vector<ks_stage_time>& stage_times() const { return stage_times_; }

 private:
  [[nodiscard]] bool use_vulkan(const simsense_parameters& parameters) const;
  uint64_t submit_to_device(const ComputeRequest& request, const StageSettings& settings);
  [[nodiscard]] bool wait_for_device(uint64_t submission, uint64_t timeout_ns);

  std::shared_ptr<ks::Device> device_;
  PreparedRig rig_;
  simsense_parameters parameters_;
  Imager imagers_[2];
  bool on_device_ = false;         // else on the CPU
  std::unique_ptr<CpuCalls> cpu_;  // each back end when first used
  std::unique_ptr<VulkanCalls> vulkan_;
  std::vector<ks_stage_time> stage_times_;
  std::atomic<uint64_t> wishes_{0};  // how often cancel() was called
};

}  // namespace simsense
