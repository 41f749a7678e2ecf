// SPDX-License-Identifier: Apache-2.0
// The facts of a physical device, and whether this project can run on it. Plain values: the refusal rule is a pure function of them.
#pragma once

#include <string>
#include <vector>

#include "device/vulkan.h"
#include "ks/device.h"

namespace ks {

struct PhysicalFacts {
  VkPhysicalDevice handle = VK_NULL_HANDLE;
  uint32_t api_version = 0;  // lesser of the device's and the instance's
  VkPhysicalDeviceProperties properties{};
  VkPhysicalDeviceIDProperties id{};
  VkPhysicalDeviceDriverProperties driver{};
  VkPhysicalDeviceFeatures features{};
  VkPhysicalDeviceVulkan11Features features11{};
  VkPhysicalDeviceVulkan12Features features12{};
  bool subgroup_size_control = false;
  uint32_t subgroup_size = 0, min_subgroup_size = 0, max_subgroup_size = 0;
  uint64_t host_pointer_alignment = 0;  // 0 without VK_EXT_external_memory_host
  uint32_t queue_family = UINT32_MAX;   // with compute; UINT32_MAX = none
  uint32_t timestamp_bits = 0;          // of that queue family
  VkPhysicalDeviceMemoryProperties memory{};
  VkExternalMemoryFeatureFlags opaque_fd = 0, dma_buf = 0;  // of our kind of buffer
  bool timeline_fd = false;
  bool ray_tracing_pipeline = false;  // all of ray_tracing_extensions, with their features
  std::vector<std::string> extensions;

  [[nodiscard]] bool has_extension(const char* name) const;
};

PhysicalFacts query_facts(VkPhysicalDevice device, uint32_t instance_version);

/// Returns every reason why this device cannot be used, joined by "; "; empty if it can.
std::string refusal(const PhysicalFacts& facts);

ks_device_info describe(const PhysicalFacts& facts, uint32_t index);

/// What ray tracing pipelines need.
inline constexpr const char* ray_tracing_extensions[] = {VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
                                                         VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME,
                                                         VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME};

/// Usage of every buffer of this project; external-memory queries must ask for the same.
inline constexpr VkBufferUsageFlags buffer_usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_SRC_BIT |
                                                   VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT |
                                                   VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

/// Facts of a VkDevice that the host made (KS_SELECT_VULKAN), for its queue: without the features and extensions that its
/// VkDeviceCreateInfo left off. Throws KS_ERROR_INVALID_ARGUMENT for a missing handle or a queue family without compute.
PhysicalFacts hosts_facts(const ks_vulkan_device& host);

/// Returns the index of the chosen device. Throws KS_ERROR_NO_DEVICE with every device's reasons; `why_none` is the reason if the list is
/// empty.
size_t select_device(const std::vector<ks_device_info>& devices, const ks_device_desc& desc, const std::string& why_none);

}  // namespace ks
