// SPDX-License-Identifier: Apache-2.0
// The ray tracing pipeline and its shader binding table: two ray generation shaders that share a miss and a closest-hit shader.
// Thread rule: immutable after construction.
#pragma once

#include "device/compute.h"

namespace kuafu {

struct RtPush {
  uint64_t words = 0, environments = 0, count = 0, top_levels = 0, scene = 0;
  uint32_t capacity = 0, environment_count = 0, has_environments = 0;
};

class RtPipeline {
 public:
  enum Entry : uint32_t { closest, occluded };

  /// cutouts: for scenes with cutout materials.
  explicit RtPipeline(std::shared_ptr<ks::Device> device, bool cutouts = false);
  ~RtPipeline();
  RtPipeline(const RtPipeline&) = delete;
  RtPipeline& operator=(const RtPipeline&) = delete;

  /// Records a launch whose size stands at arguments_offset: a VkTraceRaysIndirectCommandKHR, laid out as VkDispatchIndirectCommand.
  void trace(ks::Commands& commands, Entry entry, const RtPush& push, const ks::Buffer& arguments, uint64_t arguments_offset) const;

 private:
  void destroy();
  void create_pipeline();
  void create_table();
  [[nodiscard]] VkStridedDeviceAddressRegionKHR table_entry(uint32_t group) const {
    return {table_address_ + group * stride_, stride_, stride_};
  }

  std::shared_ptr<ks::Device> device_;
  bool cutouts_;
  VkPipelineLayout layout_ = VK_NULL_HANDLE;
  VkPipeline pipeline_ = VK_NULL_HANDLE;
  std::shared_ptr<ks::Buffer> table_;
  uint64_t table_address_ = 0, stride_ = 0;
};

}  // namespace kuafu
