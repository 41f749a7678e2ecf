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

/// Specialisation constants that several shaders share, under ids from first_id on.
struct SharedConstants {
  uint32_t first_id = 0;
  std::span<const uint32_t> values;
};

/// A compute pipeline whose only inputs are push constants (device addresses of its buffers live in them) and specialisation constants (ids
/// 0..n-1, and the shared ones).
class ComputePipeline {
 public:
  ComputePipeline(std::shared_ptr<Device> device, std::span<const uint32_t> spirv, uint32_t push_constant_bytes,
                  std::span<const uint32_t> specialisation = {}, uint32_t required_subgroup_size = 0, SharedConstants shared = {});
  ~ComputePipeline();
  ComputePipeline(const ComputePipeline&) = delete;
  ComputePipeline& operator=(const ComputePipeline&) = delete;
  [[nodiscard]] VkPipeline handle() const { return pipeline_; }
  [[nodiscard]] VkPipelineLayout layout() const { return layout_; }
  [[nodiscard]] uint32_t push_constant_bytes() const { return push_constant_bytes_; }

 private:
  std::shared_ptr<Device> device_;
  VkPipelineLayout layout_ = VK_NULL_HANDLE;
  VkPipeline pipeline_ = VK_NULL_HANDLE;
  uint32_t push_constant_bytes_ = 0;
};

/// Records dispatches; each is followed by a full barrier of all device work (compute, transfer, indirect, ray tracing) unless said
/// otherwise.
/// Stage names given to begin_stage collect GPU time (timestamps; the wall time of flushes where the queue has none).
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
  /// A line of groups, in rows where it is longer than the device's dispatches may be wide: a shader counts y * width + x, and minds that
  /// there may be more groups than asked for.
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
  /// At most 65536 bytes, taken from `data` now and written when the commands run; multiples of 4.
  void update(const Buffer& buffer, uint64_t offset_bytes, const void* data, uint64_t size_bytes);
  void copy(const Buffer& from, uint64_t from_offset, const Buffer& to, uint64_t to_offset, uint64_t size_bytes);
  void barrier();
  /// false: the caller places barriers itself.
  void set_automatic_barriers(bool on);
  /// Submits what was recorded, waits on the host, and starts recording again. A no-op when nothing was recorded.
  void flush();
  /// Submits what was recorded and returns; it runs after `wait`, which the caller keeps until then, and `timeline` reaches `value` when it
  /// has run. Nothing may be recorded before finish().
  void submit(const Timeline& timeline, uint64_t value, const TimelinePoint& wait);
  /// After the submitted work has run: takes its stage times. A no-op when nothing was submitted.
  void finish();

  void begin_stage(const char* name);
  /// Milliseconds per stage name, in order of first use, since construction or reset_stage_times(); valid after flush().
  [[nodiscard]] std::vector<std::pair<std::string, double>> stage_times() const;
  void reset_stage_times();
  /// Adds host time to a stage (a tracer on the host, a CPU stage).
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
