// SPDX-License-Identifier: Apache-2.0
#include "device/physical.h"

#include <algorithm>

#include "device/error.h"

namespace ks {
namespace {

/// The features that a chain of structs enables, as far as we use them.
struct Enabled {
  VkPhysicalDeviceFeatures base{};
  VkPhysicalDeviceVulkan11Features v11{};
  VkPhysicalDeviceVulkan12Features v12{};
  bool subgroup_size_control = false, acceleration_structure = false, ray_tracing_pipeline = false, indirect_rays = false;
};

template <class T>
const T& as(const VkBaseInStructure* s) {
  return *reinterpret_cast<const T*>(s);
}

/// A feature may be enabled by the struct of its Vulkan version or by that of the extension that it was before.
void add(const VkBaseInStructure* s, Enabled& e) {
  switch (s->sType) {
    case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2:
      e.base = as<VkPhysicalDeviceFeatures2>(s).features;
      break;
    case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_FEATURES:
      e.v11 = as<VkPhysicalDeviceVulkan11Features>(s);
      break;
    case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES:
      e.v12 = as<VkPhysicalDeviceVulkan12Features>(s);
      break;
    case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES:
      e.subgroup_size_control = as<VkPhysicalDeviceVulkan13Features>(s).subgroupSizeControl == VK_TRUE;
      break;
    case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_SIZE_CONTROL_FEATURES:
      e.subgroup_size_control = as<VkPhysicalDeviceSubgroupSizeControlFeatures>(s).subgroupSizeControl == VK_TRUE;
      break;
    case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES:
      e.v12.bufferDeviceAddress = as<VkPhysicalDeviceBufferDeviceAddressFeatures>(s).bufferDeviceAddress;
      break;
    case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SCALAR_BLOCK_LAYOUT_FEATURES:
      e.v12.scalarBlockLayout = as<VkPhysicalDeviceScalarBlockLayoutFeatures>(s).scalarBlockLayout;
      break;
    case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_TIMELINE_SEMAPHORE_FEATURES:
      e.v12.timelineSemaphore = as<VkPhysicalDeviceTimelineSemaphoreFeatures>(s).timelineSemaphore;
      break;
    case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_FLOAT16_INT8_FEATURES:
      e.v12.shaderFloat16 = as<VkPhysicalDeviceShaderFloat16Int8Features>(s).shaderFloat16;
      e.v12.shaderInt8 = as<VkPhysicalDeviceShaderFloat16Int8Features>(s).shaderInt8;
      break;
    case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_8BIT_STORAGE_FEATURES:
      e.v12.storageBuffer8BitAccess = as<VkPhysicalDevice8BitStorageFeatures>(s).storageBuffer8BitAccess;
      e.v12.uniformAndStorageBuffer8BitAccess = as<VkPhysicalDevice8BitStorageFeatures>(s).uniformAndStorageBuffer8BitAccess;
      break;
    case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_16BIT_STORAGE_FEATURES:
      e.v11.storageBuffer16BitAccess = as<VkPhysicalDevice16BitStorageFeatures>(s).storageBuffer16BitAccess;
      e.v11.uniformAndStorageBuffer16BitAccess = as<VkPhysicalDevice16BitStorageFeatures>(s).uniformAndStorageBuffer16BitAccess;
      break;
    case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_SUBGROUP_EXTENDED_TYPES_FEATURES:
      e.v12.shaderSubgroupExtendedTypes = as<VkPhysicalDeviceShaderSubgroupExtendedTypesFeatures>(s).shaderSubgroupExtendedTypes;
      break;
    case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR:
      e.acceleration_structure = as<VkPhysicalDeviceAccelerationStructureFeaturesKHR>(s).accelerationStructure == VK_TRUE;
      break;
    case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_FEATURES_KHR:
      e.ray_tracing_pipeline = as<VkPhysicalDeviceRayTracingPipelineFeaturesKHR>(s).rayTracingPipeline == VK_TRUE;
      e.indirect_rays = as<VkPhysicalDeviceRayTracingPipelineFeaturesKHR>(s).rayTracingPipelineTraceRaysIndirect == VK_TRUE;
      break;
    default:
      break;
  }
}

Enabled enabled_by(const VkDeviceCreateInfo& info) {
  Enabled e;
  if (info.pEnabledFeatures != nullptr) e.base = *info.pEnabledFeatures;
  for (auto* s = static_cast<const VkBaseInStructure*>(info.pNext); s != nullptr; s = s->pNext) add(s, e);
  return e;
}

/// Drops what needs an extension that is not enabled.
void keep_enabled(PhysicalFacts& facts, const VkDeviceCreateInfo& info) {
  facts.extensions.assign(info.ppEnabledExtensionNames, info.ppEnabledExtensionNames + info.enabledExtensionCount);
  if (!facts.has_extension(VK_KHR_EXTERNAL_MEMORY_FD_EXTENSION_NAME)) facts.opaque_fd = facts.dma_buf = 0;
  if (!facts.has_extension(VK_EXT_EXTERNAL_MEMORY_DMA_BUF_EXTENSION_NAME)) facts.dma_buf = 0;
  if (!facts.has_extension(VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME)) facts.host_pointer_alignment = 0;
  if (!facts.has_extension(VK_KHR_EXTERNAL_SEMAPHORE_FD_EXTENSION_NAME)) facts.timeline_fd = false;
  const Enabled e = enabled_by(info);
  facts.features = e.base;
  facts.features11 = e.v11;
  facts.features12 = e.v12;
  facts.features11.pNext = facts.features12.pNext = nullptr;
  facts.subgroup_size_control &= e.subgroup_size_control;
  facts.ray_tracing_pipeline &= e.acceleration_structure && e.ray_tracing_pipeline && e.indirect_rays &&
                                std::ranges::all_of(ray_tracing_extensions, [&](const char* name) { return facts.has_extension(name); });
}

void choose_queue(PhysicalFacts& facts, uint32_t family) {
  uint32_t count = 0;
  vkGetPhysicalDeviceQueueFamilyProperties(facts.handle, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  vkGetPhysicalDeviceQueueFamilyProperties(facts.handle, &count, families.data());
  if (family >= count || !(families[family].queueFlags & VK_QUEUE_COMPUTE_BIT))
    fail(KS_ERROR_INVALID_ARGUMENT, "device desc: queue_family_index is %u, which is none of the device's %u families or has no compute",
         family, count);
  facts.queue_family = family;
  facts.timestamp_bits = families[family].timestampValidBits;
}

}  // namespace

PhysicalFacts hosts_facts(const ks_vulkan_device& host) {
  const auto* info = static_cast<const VkDeviceCreateInfo*>(host.create_info);
  if (host.instance == nullptr || host.physical_device == nullptr || host.device == nullptr || host.queue == nullptr || info == nullptr)
    fail(KS_ERROR_INVALID_ARGUMENT, "device desc: vulkan has a NULL among instance, physical_device, device, queue and create_info");
  if (info->sType != VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO)
    fail(KS_ERROR_INVALID_ARGUMENT, "device desc: create_info has sType %d, a VkDeviceCreateInfo has %d", int(info->sType),
         int(VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO));
  PhysicalFacts facts = query_facts(static_cast<VkPhysicalDevice>(host.physical_device), host.api_version);
  if (facts.api_version >= VK_API_VERSION_1_2) keep_enabled(facts, *info);
  choose_queue(facts, host.queue_family_index);
  return facts;
}

}  // namespace ks
