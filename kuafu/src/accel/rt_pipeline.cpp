// SPDX-License-Identifier: Apache-2.0
#include "accel/rt_pipeline.h"

#include <array>
#include <cstring>
#include <span>

#include "accel/rt_structure.h"
#include "device/pipeline_cache.h"
#include "spirv/trace_closest_rgen.h"
#include "spirv/trace_cutout_rahit.h"
#include "spirv/trace_hit_rchit.h"
#include "spirv/trace_miss_rmiss.h"
#include "spirv/trace_occluded_rgen.h"

namespace kuafu {
namespace {

constexpr uint32_t group_miss = 2, group_hit = 3, shader_group_count = 4;  // the first two are RtPipeline::Entry

struct Stage {
  VkShaderStageFlagBits stage;
  std::span<const uint32_t> spirv;
};
// One shader per group, in the order of groups; then what the hit group has beside it where there are cutouts.
constexpr uint32_t stage_cutout = shader_group_count, stage_count = shader_group_count + 1;
constexpr VkShaderStageFlags push_stages = VK_SHADER_STAGE_RAYGEN_BIT_KHR | VK_SHADER_STAGE_ANY_HIT_BIT_KHR;
const std::array<Stage, stage_count> stages{{{VK_SHADER_STAGE_RAYGEN_BIT_KHR, trace_closest_rgen_spirv},
                                             {VK_SHADER_STAGE_RAYGEN_BIT_KHR, trace_occluded_rgen_spirv},
                                             {VK_SHADER_STAGE_MISS_BIT_KHR, trace_miss_rmiss_spirv},
                                             {VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, trace_hit_rchit_spirv},
                                             {VK_SHADER_STAGE_ANY_HIT_BIT_KHR, trace_cutout_rahit_spirv}}};

/// Shader modules that live until the pipeline is made.
struct Modules {
  explicit Modules(const ks::Device& d) : device(d) {
    for (size_t i = 0; i < stages.size(); ++i) {
      VkShaderModuleCreateInfo info{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO};
      info.codeSize = stages[i].spirv.size_bytes();
      info.pCode = stages[i].spirv.data();
      ks::check(device.vk().vkCreateShaderModule(device.handle(), &info, nullptr, &handles[i]), "vkCreateShaderModule");
    }
  }
  ~Modules() {
    for (VkShaderModule module : handles) device.vk().vkDestroyShaderModule(device.handle(), module, nullptr);
  }
  Modules(const Modules&) = delete;
  Modules& operator=(const Modules&) = delete;
  const ks::Device& device;
  std::array<VkShaderModule, stage_count> handles{};
};

VkRayTracingShaderGroupCreateInfoKHR shader_group(uint32_t index, bool cutouts) {
  VkRayTracingShaderGroupCreateInfoKHR group{VK_STRUCTURE_TYPE_RAY_TRACING_SHADER_GROUP_CREATE_INFO_KHR};
  const bool hit = index == group_hit;
  group.type = hit ? VK_RAY_TRACING_SHADER_GROUP_TYPE_TRIANGLES_HIT_GROUP_KHR : VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR;
  group.generalShader = hit ? VK_SHADER_UNUSED_KHR : index;
  group.closestHitShader = hit ? index : VK_SHADER_UNUSED_KHR;
  group.anyHitShader = hit && cutouts ? stage_cutout : VK_SHADER_UNUSED_KHR;
  group.intersectionShader = VK_SHADER_UNUSED_KHR;
  return group;
}

}  // namespace

RtPipeline::RtPipeline(std::shared_ptr<ks::Device> device, bool cutouts) : device_(std::move(device)), cutouts_(cutouts) {
  const VkPushConstantRange range{push_stages, 0, sizeof(RtPush)};
  VkPipelineLayoutCreateInfo info{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO};
  info.pushConstantRangeCount = 1;
  info.pPushConstantRanges = &range;
  ks::check(device_->vk().vkCreatePipelineLayout(device_->handle(), &info, nullptr, &layout_), "vkCreatePipelineLayout");
  try {
    create_pipeline();
    create_table();
  } catch (...) {
    destroy();
    throw;
  }
}

RtPipeline::~RtPipeline() { destroy(); }

void RtPipeline::destroy() {
  device_->vk().vkDestroyPipeline(device_->handle(), pipeline_, nullptr);
  device_->vk().vkDestroyPipelineLayout(device_->handle(), layout_, nullptr);
}

void RtPipeline::create_pipeline() {
  const Modules modules(*device_);
  std::array<VkPipelineShaderStageCreateInfo, stage_count> shaders{};
  std::array<VkRayTracingShaderGroupCreateInfoKHR, shader_group_count> groups{};
  for (uint32_t i = 0; i < stage_count; ++i) {
    shaders[i] = {VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO};
    shaders[i].stage = stages[i].stage;
    shaders[i].module = modules.handles[i];
    shaders[i].pName = "main";
  }
  for (uint32_t i = 0; i < shader_group_count; ++i) groups[i] = shader_group(i, cutouts_);
  VkRayTracingPipelineCreateInfoKHR info{VK_STRUCTURE_TYPE_RAY_TRACING_PIPELINE_CREATE_INFO_KHR};
  info.stageCount = cutouts_ ? stage_count : shader_group_count;
  info.groupCount = shader_group_count;
  info.pStages = shaders.data();
  info.pGroups = groups.data();
  info.maxPipelineRayRecursionDepth = 1;
  info.layout = layout_;
  ks::check(device_->vk().vkCreateRayTracingPipelinesKHR(device_->handle(), VK_NULL_HANDLE, device_->pipeline_cache().for_new_pipeline(), 1,
                                                         &info, nullptr, &pipeline_),
            "building the ray tracing pipeline");
}

/// Every group has one record, alone in its region; regions start at the base alignment.
void RtPipeline::create_table() {
  VkPhysicalDeviceRayTracingPipelinePropertiesKHR facts{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_PROPERTIES_KHR};
  VkPhysicalDeviceProperties2 all{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &facts};
  vkGetPhysicalDeviceProperties2(device_->physical(), &all);
  const uint64_t handle_bytes = facts.shaderGroupHandleSize, alignment = facts.shaderGroupBaseAlignment;
  std::vector<std::byte> handles(shader_group_count * handle_bytes);
  ks::check(device_->vk().vkGetRayTracingShaderGroupHandlesKHR(device_->handle(), pipeline_, 0, shader_group_count, handles.size(),
                                                               handles.data()),
            "vkGetRayTracingShaderGroupHandlesKHR");
  stride_ = round_up(handle_bytes, alignment);
  table_ = ks::Buffer::create(device_, shader_group_count * stride_ + alignment, 0, VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR);
  table_address_ = round_up(table_->address(), alignment);
  for (uint64_t i = 0; i < shader_group_count; ++i)
    table_->write(table_address_ - table_->address() + i * stride_, &handles[i * handle_bytes], handle_bytes);
}

void RtPipeline::trace(ks::Commands& commands, Entry entry, const RtPush& push, const ks::Buffer& arguments,
                       uint64_t arguments_offset) const {
  const VolkDeviceTable& vk = device_->vk();
  VkCommandBuffer buffer = commands.handle();
  vk.vkCmdBindPipeline(buffer, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, pipeline_);
  vk.vkCmdPushConstants(buffer, layout_, push_stages, 0, sizeof push, &push);
  const VkStridedDeviceAddressRegionKHR generation = table_entry(entry), misses = table_entry(group_miss), hits = table_entry(group_hit),
                                        callables{};
  vk.vkCmdTraceRaysIndirectKHR(buffer, &generation, &misses, &hits, &callables, arguments.address() + arguments_offset);
  commands.barrier();
}

}  // namespace kuafu
