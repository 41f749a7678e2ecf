// SPDX-License-Identifier: Apache-2.0
// A host program's own Vulkan: instance, device (the CPU's, where there is one) with what the libraries need, queue and commands.
#pragma once

#include <mutex>
#include <vector>

#include "ks/device.h"
#include "volk.h"

namespace ks::test {

class VulkanHost {
 public:
  /// features: what the device is made with; NULL: what the libraries can use. Look at device() before anything else: it may be NULL.
  explicit VulkanHost(const VkPhysicalDeviceVulkan12Features* features = nullptr);
  ~VulkanHost();
  VulkanHost(const VulkanHost&) = delete;
  VulkanHost& operator=(const VulkanHost&) = delete;

  [[nodiscard]] VkDevice device() const { return device_; }
  /// What the libraries are given; valid while this lives.
  [[nodiscard]] const ks_vulkan_device& desc() const { return desc_; }
  [[nodiscard]] int times_locked() const { return times_locked_; }

  struct Memory {
    VkBuffer buffer;
    VkDeviceMemory memory;
    uint32_t type;
    uint64_t bytes;
    uint32_t* mapped;
  };
  /// Host-visible memory of at least so many bytes, with a buffer in it. Freed with this.
  Memory allocate(uint64_t bytes);
  /// Writes words into foreign memory on the queue, and waits.
  void fill(VkDeviceMemory memory, uint64_t bytes, uint32_t word);
  /// At 0. Destroyed with this.
  VkSemaphore timeline();
  void signal(VkSemaphore timeline, uint64_t value);
  bool wait(VkSemaphore timeline, uint64_t value, uint64_t timeout_ns);

 private:
  VkBuffer make_buffer(uint64_t bytes);
  VkPhysicalDevice choose_device() const;
  uint32_t mappable_type(uint32_t allowed) const;
  static void lock(void* self, uint32_t locked);

  VkInstance instance_ = VK_NULL_HANDLE;
  VkPhysicalDevice physical_ = VK_NULL_HANDLE;
  VkDevice device_ = VK_NULL_HANDLE;
  VkQueue queue_ = VK_NULL_HANDLE;
  std::mutex queue_mutex_;
  int times_locked_ = 0;
  VkPhysicalDeviceVulkan11Features features11_{};
  VkPhysicalDeviceVulkan12Features features12_{};
  VkPhysicalDeviceFeatures2 features_{};
  VkDeviceQueueCreateInfo queue_info_{};
  VkDeviceCreateInfo device_info_{};
  ks_vulkan_device desc_ = ks_vulkan_device_init();
  std::vector<Memory> memories_;
  std::vector<VkSemaphore> timelines_;
};

}  // namespace ks::test
