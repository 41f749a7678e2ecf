// SPDX-License-Identifier: Apache-2.0
// Recording and running compute work: pipelines from embedded SPIR-V, and a command recorder that can be flushed in the middle (host stages
// read the result).
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "device/buffer.h"

namespace ks {

class Timeline;
struct TimelinePoint;

/// Specialisation constants that several shaders share; their ids begin at first_id.
struct SharedConstants {
  uint32_t first_id = 0;
  std::span<const uint32_t> values;
};

/// A compute pipeline; its device must outlive it. Its inputs are push constants, which hold its buffers' device addresses, and
/// specialisation constants: ids 0..n-1 and the shared ones.
class ComputePipeline {
 public:
  ComputePipeline(const Device& device, std::span<const uint32_t> spirv, uint32_t push_constant_bytes,
                  std::span<const uint32_t> specialisation = {}, uint32_t required_subgroup_size = 0, SharedConstants shared = {});
  ~ComputePipeline();
  ComputePipeline(const ComputePipeline&) = delete;
  ComputePipeline& operator=(const ComputePipeline&) = delete;
  [[nodiscard]] VkPipeline handle() const { return pipeline_; }
  [[nodiscard]] VkPipelineLayout layout() const { return layout_; }
  [[nodiscard]] uint32_t push_constant_bytes() const { return push_constant_bytes_; }

 private:
  const Device& device_;
  VkPipelineLayout layout_ = VK_NULL_HANDLE;
  VkPipeline pipeline_ = VK_NULL_HANDLE;
  uint32_t push_constant_bytes_ = 0;
};

/// Records dispatches. A full barrier of all device work (compute, transfer, indirect, ray tracing) follows each, unless automatic barriers
/// are off.
/// Names given to begin_stage() collect GPU time by timestamps, or the wall time of flushes if the queue has none.
class Commands {
 public:
  explicit Commands(std::shared_ptr<Device> device);
  ~Commands();
  Commands(const Commands&) = delete;
  Commands& operator=(const Commands&) = delete;

  template <class Push>
  void dispatch(const ComputePipeline& pipeline, const Push& push, uint32_t groups_x, uint32_t groups_y = 1, uint32_t groups_z = 1) {
    dispatch_raw(pipeline, &push, sizeof(Push), groups_x, groups_y, groups_z);
  }
  /// Dispatches a line of groups, broken into rows if the device limits its width. A shader computes its index as y * width + x, and
  /// ignores groups beyond the line.
  template <class Push>
  void dispatch_line(const ComputePipeline& pipeline, const Push& push, uint32_t groups) {
    const uint32_t rows = groups == 0 ? 0 : (groups - 1) / most_groups() + 1;
    dispatch(pipeline, push, rows == 0 ? 0 : (groups - 1) / rows + 1, rows);
  }
  template <class Push>
  void dispatch_indirect(const ComputePipeline& pipeline, const Push& push, const Buffer& arguments, uint64_t offset_bytes) {
    dispatch_indirect_raw(pipeline, &push, sizeof(Push), arguments, offset_bytes);
  }
  void fill(const Buffer& buffer, uint64_t offset_bytes, uint64_t size_bytes, uint32_t value);
  /// Writes up to 65536 bytes, a multiple of 4, when the commands run. `data` is copied now.
  void update(const Buffer& buffer, uint64_t offset_bytes, const void* data, uint64_t size_bytes);
  void copy(const Buffer& from, uint64_t from_offset, const Buffer& to, uint64_t to_offset, uint64_t size_bytes);
  void barrier();
  /// on = false: the caller places the barriers.
  void set_automatic_barriers(bool on);
  /// Submits the recorded commands, waits for them on the host, and starts a new recording. Does nothing if none were recorded.
  void flush();
  /// Submits the recorded commands and returns. They run after `wait`, which the caller must keep until then; `timeline` then reaches
  /// `value`. Nothing may be recorded before finish().
  void submit(const Timeline& timeline, uint64_t value, const TimelinePoint& wait);
  /// Reads the stage times after the submitted work has run. Does nothing if nothing was submitted.
  void finish();

  void begin_stage(const char* name);
  /// Milliseconds of each stage since construction or reset_stage_times(), in the order of first use; valid after flush().
  [[nodiscard]] std::vector<std::pair<std::string, double>> stage_times() const;
  void reset_stage_times();
  /// Adds host time to a stage, such as a tracer's on the host.
  void add_host_time(const char* name, double milliseconds);

  [[nodiscard]] const std::shared_ptr<Device>& device() const;
  [[nodiscard]] VkCommandBuffer handle();  ///< begun; for what this class does not cover: follow it with barrier()

 private:
  [[nodiscard]] uint32_t most_groups() const;  // of a dispatch, along x
  void dispatch_raw(const ComputePipeline&, const void* push, size_t push_bytes, uint32_t x, uint32_t y, uint32_t z);
  void dispatch_indirect_raw(const ComputePipeline&, const void* push, size_t push_bytes, const Buffer& arguments, uint64_t offset_bytes);
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace ks
