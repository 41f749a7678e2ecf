// SPDX-License-Identifier: Apache-2.0
// Shader module, layout and pipeline in one step; nothing is left behind when a step fails.
#include <algorithm>

#include "device/compute.h"
#include "device/error.h"
#include "device/pipeline_cache.h"

namespace ks {
namespace {

void check_request(const Device& device, uint32_t push_constant_bytes, uint32_t required_subgroup_size) {
  if (!device.has_vulkan()) fail(KS_ERROR_UNSUPPORTED, "compute work needs a Vulkan device, this is the host device");
  if (push_constant_bytes > device.limits().maxPushConstantsSize)
    fail(KS_ERROR_UNSUPPORTED, "a pipeline wants %u bytes of push constants, %s has %u", push_constant_bytes, device.info().name,
         device.limits().maxPushConstantsSize);
  if (required_subgroup_size != 0 && required_subgroup_size != device.subgroup_size() &&
      !device.can_require_subgroup_size(required_subgroup_size))
    fail(KS_ERROR_UNSUPPORTED, "%s cannot run a pipeline with subgroups of %u (its own are %u)", device.info().name, required_subgroup_size,
         device.subgroup_size());
}

}  // namespace

ComputePipeline::ComputePipeline(const Device& device, std::span<const uint32_t> spirv, uint32_t push_constant_bytes,
                                 std::span<const uint32_t> specialisation, uint32_t required_subgroup_size, SharedConstants shared)
    : device_(device), push_constant_bytes_(push_constant_bytes) {
  check_request(device_, push_constant_bytes, required_subgroup_size);
  const VolkDeviceTable& vk = device_.vk();

  const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0, push_constant_bytes};
  VkPipelineLayoutCreateInfo layout{VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO};
  layout.pushConstantRangeCount = push_constant_bytes > 0 ? 1 : 0;
  layout.pPushConstantRanges = &range;
  check(vk.vkCreatePipelineLayout(device_.handle(), &layout, nullptr, &layout_), "vkCreatePipelineLayout");

  VkShaderModuleCreateInfo code{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO};
  code.codeSize = spirv.size_bytes();
  code.pCode = spirv.data();
  VkShaderModule module = VK_NULL_HANDLE;
  VkResult result = vk.vkCreateShaderModule(device_.handle(), &code, nullptr, &module);

  std::vector<uint32_t> values(specialisation.begin(), specialisation.end());
  values.insert(values.end(), shared.values.begin(), shared.values.end());
  const auto own = static_cast<uint32_t>(specialisation.size());
  std::vector<VkSpecializationMapEntry> entries;
  for (uint32_t i = 0; i < values.size(); ++i)
    entries.push_back({i < own ? i : shared.first_id + i - own, static_cast<uint32_t>(i * sizeof(uint32_t)), sizeof(uint32_t)});
  const VkSpecializationInfo constants{static_cast<uint32_t>(entries.size()), entries.data(), values.size() * sizeof(uint32_t),
                                       values.data()};
  VkPipelineShaderStageRequiredSubgroupSizeCreateInfo subgroup{VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_REQUIRED_SUBGROUP_SIZE_CREATE_INFO};
  subgroup.requiredSubgroupSize = required_subgroup_size;
  VkComputePipelineCreateInfo info{VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO};
  info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  info.stage.pNext = device_.can_require_subgroup_size(required_subgroup_size) ? &subgroup : nullptr;
  info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  info.stage.module = module;
  info.stage.pName = "main";
  info.stage.pSpecializationInfo = &constants;
  info.layout = layout_;
  if (result == VK_SUCCESS)
    result = vk.vkCreateComputePipelines(device_.handle(), device_.pipeline_cache().for_new_pipeline(), 1, &info, nullptr, &pipeline_);
  vk.vkDestroyShaderModule(device_.handle(), module, nullptr);
  if (result != VK_SUCCESS) vk.vkDestroyPipelineLayout(device_.handle(), layout_, nullptr);
  check(result, "building a compute pipeline");
}

ComputePipeline::~ComputePipeline() {
  device_.vk().vkDestroyPipeline(device_.handle(), pipeline_, nullptr);
  device_.vk().vkDestroyPipelineLayout(device_.handle(), layout_, nullptr);
}

}  // namespace ks
