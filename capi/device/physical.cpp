// SPDX-License-Identifier: Apache-2.0
#include "device/physical.h"

#include <algorithm>
#include <cstdio>
#include <cstring>

namespace ks {
namespace {

std::vector<std::string> extension_names(VkPhysicalDevice device) {
  uint32_t count = 0;
  check(vkEnumerateDeviceExtensionProperties(device, nullptr, &count, nullptr), "vkEnumerateDeviceExtensionProperties");
  std::vector<VkExtensionProperties> found(count);
  check(vkEnumerateDeviceExtensionProperties(device, nullptr, &count, found.data()), "vkEnumerateDeviceExtensionProperties");
  std::vector<std::string> names;
  for (uint32_t i = 0; i < count; ++i) names.emplace_back(found[i].extensionName);
  return names;
}

// Compute without graphics, where there is such a family, does not compete with a desktop; else the first family that computes.
void choose_queue_family(PhysicalFacts& facts) {
  uint32_t count = 0;
  vkGetPhysicalDeviceQueueFamilyProperties(facts.handle, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  vkGetPhysicalDeviceQueueFamilyProperties(facts.handle, &count, families.data());
  for (const bool with_graphics : {false, true})
    for (uint32_t i = 0; i < count && facts.queue_family == UINT32_MAX; ++i) {
      const VkQueueFlags flags = families[i].queueFlags;
      if (!(flags & VK_QUEUE_COMPUTE_BIT) || families[i].queueCount == 0) continue;
      if (!with_graphics && (flags & VK_QUEUE_GRAPHICS_BIT)) continue;
      facts.queue_family = i;
      facts.timestamp_bits = families[i].timestampValidBits;
    }
}

void query_properties(PhysicalFacts& facts) {
  const bool host_import = facts.has_extension(VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME);
  VkPhysicalDeviceExternalMemoryHostPropertiesEXT host{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_MEMORY_HOST_PROPERTIES_EXT};
  VkPhysicalDeviceSubgroupSizeControlProperties subgroup_control{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_SIZE_CONTROL_PROPERTIES};
  VkPhysicalDeviceSubgroupProperties subgroup{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_PROPERTIES};
  facts.driver.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DRIVER_PROPERTIES;
  facts.id.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ID_PROPERTIES;
  VkPhysicalDeviceProperties2 all{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &facts.id};
  facts.id.pNext = &facts.driver;
  facts.driver.pNext = &subgroup;
  void** tail = &subgroup.pNext;
  if (host_import) {
    *tail = &host;
    tail = &host.pNext;
  }
  if (facts.subgroup_size_control) *tail = &subgroup_control;
  vkGetPhysicalDeviceProperties2(facts.handle, &all);
  facts.id.pNext = facts.driver.pNext = nullptr;
  facts.subgroup_size = subgroup.subgroupSize;
  facts.min_subgroup_size = facts.subgroup_size_control ? subgroup_control.minSubgroupSize : subgroup.subgroupSize;
  facts.max_subgroup_size = facts.subgroup_size_control ? subgroup_control.maxSubgroupSize : subgroup.subgroupSize;
  facts.subgroup_size_control &= (subgroup_control.requiredSubgroupSizeStages & VK_SHADER_STAGE_COMPUTE_BIT) != 0;
  if (host_import) facts.host_pointer_alignment = host.minImportedHostPointerAlignment;
}

void query_features(PhysicalFacts& facts) {
  const bool may_control = facts.api_version >= VK_API_VERSION_1_3 || facts.has_extension(VK_EXT_SUBGROUP_SIZE_CONTROL_EXTENSION_NAME);
  VkPhysicalDeviceSubgroupSizeControlFeatures control{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_SIZE_CONTROL_FEATURES};
  facts.features11.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_FEATURES;
  facts.features12.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
  VkPhysicalDeviceFeatures2 all{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &facts.features11};
  facts.features11.pNext = &facts.features12;
  void** tail = &facts.features12.pNext;
  if (may_control) {
    *tail = &control;
    tail = &control.pNext;
  }
  VkPhysicalDeviceRayTracingPipelineFeaturesKHR pipeline{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_FEATURES_KHR};
  VkPhysicalDeviceAccelerationStructureFeaturesKHR structure{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR,
                                                             &pipeline};
  const bool may_trace = std::ranges::all_of(ray_tracing_extensions, [&](const char* name) { return facts.has_extension(name); });
  if (may_trace) *tail = &structure;
  vkGetPhysicalDeviceFeatures2(facts.handle, &all);
  facts.features11.pNext = facts.features12.pNext = nullptr;
  facts.features = all.features;
  facts.subgroup_size_control = control.subgroupSizeControl == VK_TRUE;
  facts.ray_tracing_pipeline =
      structure.accelerationStructure && pipeline.rayTracingPipeline && pipeline.rayTracingPipelineTraceRaysIndirect;
}

VkExternalMemoryFeatureFlags query_buffers(VkPhysicalDevice device, VkExternalMemoryHandleTypeFlagBits handle_type) {
  VkPhysicalDeviceExternalBufferInfo info{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_BUFFER_INFO};
  info.usage = buffer_usage;
  info.handleType = handle_type;
  VkExternalBufferProperties found{VK_STRUCTURE_TYPE_EXTERNAL_BUFFER_PROPERTIES};
  vkGetPhysicalDeviceExternalBufferProperties(device, &info, &found);
  return found.externalMemoryProperties.externalMemoryFeatures;
}

void query_sharing(PhysicalFacts& facts) {
  if (facts.has_extension(VK_KHR_EXTERNAL_MEMORY_FD_EXTENSION_NAME)) {
    facts.opaque_fd = query_buffers(facts.handle, VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT);
    if (facts.has_extension(VK_EXT_EXTERNAL_MEMORY_DMA_BUF_EXTENSION_NAME))
      facts.dma_buf = query_buffers(facts.handle, VK_EXTERNAL_MEMORY_HANDLE_TYPE_DMA_BUF_BIT_EXT);
  }
  if (facts.has_extension(VK_KHR_EXTERNAL_SEMAPHORE_FD_EXTENSION_NAME)) {
    VkSemaphoreTypeCreateInfo timeline{VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO};
    timeline.semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE;
    VkPhysicalDeviceExternalSemaphoreInfo info{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_SEMAPHORE_INFO, &timeline};
    info.handleType = VK_EXTERNAL_SEMAPHORE_HANDLE_TYPE_OPAQUE_FD_BIT;
    VkExternalSemaphoreProperties found{VK_STRUCTURE_TYPE_EXTERNAL_SEMAPHORE_PROPERTIES};
    vkGetPhysicalDeviceExternalSemaphoreProperties(facts.handle, &info, &found);
    const auto both = VK_EXTERNAL_SEMAPHORE_FEATURE_EXPORTABLE_BIT | VK_EXTERNAL_SEMAPHORE_FEATURE_IMPORTABLE_BIT;
    facts.timeline_fd = (found.externalSemaphoreFeatures & both) == both;
  }
}

uint32_t kind_of(VkPhysicalDeviceType type) {
  switch (type) {
    case VK_PHYSICAL_DEVICE_TYPE_CPU:
      return KS_DEVICE_KIND_CPU;
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU:
      return KS_DEVICE_KIND_INTEGRATED_GPU;
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU:
      return KS_DEVICE_KIND_DISCRETE_GPU;
    case VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU:
      return KS_DEVICE_KIND_VIRTUAL_GPU;
    default:
      return KS_DEVICE_KIND_OTHER;
  }
}

}  // namespace

bool PhysicalFacts::has_extension(const char* name) const {
  return std::find(extensions.begin(), extensions.end(), name) != extensions.end();
}

PhysicalFacts query_facts(VkPhysicalDevice device, uint32_t instance_version) {
  PhysicalFacts facts;
  facts.handle = device;
  vkGetPhysicalDeviceProperties(device, &facts.properties);
  facts.api_version = std::min(facts.properties.apiVersion, instance_version);
  vkGetPhysicalDeviceMemoryProperties(device, &facts.memory);
  choose_queue_family(facts);
  // Below 1.2 the structures that follow do not exist, and the device is refused anyway.
  if (facts.api_version < VK_API_VERSION_1_2) return facts;
  facts.extensions = extension_names(device);
  query_features(facts);
  query_properties(facts);
  query_sharing(facts);
  return facts;
}

std::string refusal(const PhysicalFacts& facts) {
  std::string reasons;
  const auto add = [&reasons](const std::string& reason) { reasons += (reasons.empty() ? "" : "; ") + reason; };
  if (facts.queue_family == UINT32_MAX) add("no compute queue");
  if (facts.api_version < VK_API_VERSION_1_2) {
    add("Vulkan " + std::to_string(VK_API_VERSION_MAJOR(facts.api_version)) + "." +
        std::to_string(VK_API_VERSION_MINOR(facts.api_version)) +
        ", needs 1.2 or newer (so bufferDeviceAddress and scalarBlockLayout are missing too): update the driver");
    return reasons;
  }
  if (!facts.features12.bufferDeviceAddress) add("feature bufferDeviceAddress is missing");
  if (!facts.features12.scalarBlockLayout) add("feature scalarBlockLayout is missing");
  return reasons;
}

ks_device_info describe(const PhysicalFacts& facts, uint32_t index) {
  ks_device_info info = ks_device_info_init();
  std::snprintf(info.name, sizeof info.name, "%s", facts.properties.deviceName);
  // Both parts fit: the driver gives at most 255 characters in all that matter, and a cut is harmless.
  std::snprintf(info.driver, sizeof info.driver, "%.120s %.120s", facts.driver.driverName, facts.driver.driverInfo);
  const std::string refused = refusal(facts);
  std::snprintf(info.refused, sizeof info.refused, "%s", refused.c_str());
  std::memcpy(info.device_uuid, facts.id.deviceUUID, sizeof info.device_uuid);
  std::memcpy(info.driver_uuid, facts.id.driverUUID, sizeof info.driver_uuid);
  info.index = index;
  info.kind = kind_of(facts.properties.deviceType);
  info.api_version = facts.properties.apiVersion;
  info.usable = refused.empty() ? 1 : 0;
  if (facts.opaque_fd & VK_EXTERNAL_MEMORY_FEATURE_EXPORTABLE_BIT) info.capabilities |= KS_CAP_EXPORT_OPAQUE_FD;
  if (facts.opaque_fd & VK_EXTERNAL_MEMORY_FEATURE_IMPORTABLE_BIT) info.capabilities |= KS_CAP_IMPORT_OPAQUE_FD;
  if (facts.dma_buf & VK_EXTERNAL_MEMORY_FEATURE_EXPORTABLE_BIT) info.capabilities |= KS_CAP_EXPORT_DMA_BUF;
  if (facts.dma_buf & VK_EXTERNAL_MEMORY_FEATURE_IMPORTABLE_BIT) info.capabilities |= KS_CAP_IMPORT_DMA_BUF;
  if (facts.host_pointer_alignment != 0) info.capabilities |= KS_CAP_IMPORT_HOST_POINTER;
  info.capabilities |= KS_CAP_EXPORT_HOST_POINTER;  // Vulkan guarantees a host-visible coherent memory type
  if (facts.ray_tracing_pipeline) info.capabilities |= KS_CAP_RAY_TRACING_PIPELINE;
  if (facts.timeline_fd) info.capabilities |= KS_CAP_TIMELINE_FD;
  for (uint32_t i = 0; i < facts.memory.memoryHeapCount; ++i)
    if (facts.memory.memoryHeaps[i].flags & VK_MEMORY_HEAP_DEVICE_LOCAL_BIT)
      info.memory_bytes = std::max<uint64_t>(info.memory_bytes, facts.memory.memoryHeaps[i].size);
  return info;
}

}  // namespace ks
