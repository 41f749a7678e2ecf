// SPDX-License-Identifier: Apache-2.0
// Time per named stage of recorded work: timestamps between stage marks, or the wall time of a flush where the queue has no timestamps.
// Thread rule: externally synchronised.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "device/device.h"

namespace ks {

class StageClock {
 public:
  explicit StageClock(std::shared_ptr<Device> device) : device_(std::move(device)) {}
  ~StageClock();
  StageClock(const StageClock&) = delete;
  StageClock& operator=(const StageClock&) = delete;

  /// Assigns the time from here on to the stage `name`. commands: VK_NULL_HANDLE while nothing is being recorded.
  void begin_stage(const char* name, VkCommandBuffer commands);
  void begin_recording(VkCommandBuffer commands);
  void end_recording(VkCommandBuffer commands);
  /// Reads the times after the recorded commands have run. wall_ms: how long the host waited.
  void collect(double wall_ms);
  void add(const char* name, double milliseconds);

  [[nodiscard]] const std::vector<std::pair<std::string, double>>& times() const { return times_; }
  void reset_times();

 private:
  [[nodiscard]] bool running() const { return current_ != SIZE_MAX; }
  [[nodiscard]] bool has_timestamps() const { return device_->timestamp_bits() > 0; }
  size_t stage_index(const char* name);
  void mark(VkCommandBuffer commands);
  std::vector<uint64_t> read_ticks() const;

  std::shared_ptr<Device> device_;
  std::vector<std::pair<std::string, double>> times_;
  std::vector<size_t> marks_;  // stage that begins at each timestamp of this recording; the last one ends it
  std::vector<VkQueryPool> pools_;
  size_t current_ = SIZE_MAX;
};

}  // namespace ks
