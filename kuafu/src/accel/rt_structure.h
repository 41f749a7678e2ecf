// SPDX-License-Identifier: Apache-2.0
// Acceleration structures of VK_KHR_acceleration_structure: owning handles, and the builder that makes and refits many in one go.
// Thread rule: externally synchronised.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "accel/array_buffer.h"
#include "device/compute.h"

namespace kuafu {

/// Rounds up to a multiple of step.
inline uint64_t round_up(uint64_t n, uint64_t step) { return (n + step - 1) / step * step; }

class RtStructure {
 public:
  RtStructure(std::shared_ptr<ks::Buffer> storage, uint64_t offset_bytes, uint64_t size_bytes, VkAccelerationStructureTypeKHR type);
  ~RtStructure();
  RtStructure(RtStructure&& other) noexcept;
  RtStructure& operator=(RtStructure&& other) noexcept;
  [[nodiscard]] VkAccelerationStructureKHR handle() const { return handle_; }
  [[nodiscard]] uint64_t address() const { return address_; }

 private:
  std::shared_ptr<ks::Buffer> storage_;
  VkAccelerationStructureKHR handle_ = VK_NULL_HANDLE;
  uint64_t address_ = 0;
};

/// The input of an acceleration structure: one geometry.
struct RtInput {
  VkAccelerationStructureGeometryKHR geometry;
  uint32_t primitives;
  bool updatable;  // may be refitted later

  /// Triangles of packed float3 positions and uint3 indices, at device addresses aligned to 4.
  static RtInput triangles(uint64_t positions, uint32_t vertex_count, uint64_t indices, uint32_t triangle_count, bool updatable);
  /// Instances: VkAccelerationStructureInstanceKHR at a device address aligned to 16.
  static RtInput instances(uint64_t records, uint32_t count);
};

class RtBuilder {
 public:
  explicit RtBuilder(std::shared_ptr<ks::Device> device);

  /// Builds structures of one type in `storage`, which grows if needed. Former structures in it are overwritten and must be gone.
  std::vector<RtStructure> build(std::vector<RtInput> inputs, ArrayBuffer& storage);
  /// Plans what build() does for the next record(), and drops plans that were not recorded.
  std::vector<RtStructure> plan(std::vector<RtInput> inputs, ArrayBuffer& storage);
  /// Records the planned builds. Returns whether there were any.
  bool record(ks::Commands& commands);
  /// Updates structures in place for new positions with the same topology.
  void refit(std::vector<RtInput> inputs, std::span<RtStructure* const> structures);

 private:
  using Infos = std::vector<VkAccelerationStructureBuildGeometryInfoKHR>;
  struct Job {
    std::vector<RtInput> inputs;
    Infos infos;  // point into inputs
    std::vector<uint64_t> scratch_bytes;
  };
  [[nodiscard]] static Job describe(std::vector<RtInput> inputs, VkBuildAccelerationStructureModeKHR mode);
  [[nodiscard]] VkAccelerationStructureBuildSizesInfoKHR sizes(const VkAccelerationStructureBuildGeometryInfoKHR& info,
                                                               uint32_t primitives) const;
  std::vector<RtStructure> lay_out(Job& job, ArrayBuffer& storage) const;
  void record(ks::Commands& commands, Job& job);
  void run(Job& job);

  std::shared_ptr<ks::Device> device_;
  uint64_t scratch_alignment_;
  ArrayBuffer scratch_{0, ArrayBuffer::Writer::device};
  std::optional<Job> planned_;
};

inline constexpr VkBufferUsageFlags rt_storage_usage = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR;
inline constexpr VkBufferUsageFlags rt_input_usage = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;

}  // namespace kuafu
