// SPDX-License-Identifier: Apache-2.0
// The host's own copy of volk, as any program has it: the libraries hide theirs.
#define VOLK_IMPLEMENTATION
#include "capi/vulkan_host.h"

#include <gtest/gtest.h>

#include <cstring>

namespace ks::test {

VulkanHost::VulkanHost(const VkPhysicalDeviceVulkan12Features* features) {
  if (volkInitialize() != VK_SUCCESS) return;
  VkApplicationInfo application{VK_STRUCTURE_TYPE_APPLICATION_INFO};
  application.apiVersion = VK_API_VERSION_1_2;
  VkInstanceCreateInfo instance{VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO};
  instance.pApplicationInfo = &application;
  if (vkCreateInstance(&instance, nullptr, &instance_) != VK_SUCCESS) return;
  volkLoadInstance(instance_);
  physical_ = choose_device();
  if (physical_ == VK_NULL_HANDLE) return;

  features11_.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_FEATURES;
  features12_.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
  features_.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2;
  features_.pNext = &features11_, features11_.pNext = &features12_;
  vkGetPhysicalDeviceFeatures2(physical_, &features_);
  if (features != nullptr) features12_ = *features;
  static constexpr float priority = 1.0f;
  queue_info_ = {VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO};
  queue_info_.queueCount = 1, queue_info_.pQueuePriorities = &priority;  // of every driver that the tests met the first family computes
  device_info_ = {VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, &features_};
  device_info_.queueCreateInfoCount = 1, device_info_.pQueueCreateInfos = &queue_info_;
  if (vkCreateDevice(physical_, &device_info_, nullptr, &device_) != VK_SUCCESS) return;
  vkGetDeviceQueue(device_, 0, 0, &queue_);
  desc_.instance = instance_, desc_.physical_device = physical_, desc_.device = device_, desc_.queue = queue_;
  desc_.create_info = &device_info_, desc_.api_version = application.apiVersion;
  desc_.lock_queue = lock, desc_.lock_user = this;
}

VulkanHost::~VulkanHost() {
  if (device_ != VK_NULL_HANDLE) {
    EXPECT_EQ(vkDeviceWaitIdle(device_), VK_SUCCESS) << "the host's device does not work any more";
    for (const Memory& m : memories_) vkDestroyBuffer(device_, m.buffer, nullptr), vkFreeMemory(device_, m.memory, nullptr);
    for (VkSemaphore timeline : timelines_) vkDestroySemaphore(device_, timeline, nullptr);
    vkDestroyDevice(device_, nullptr);
  }
  if (instance_ != VK_NULL_HANDLE) vkDestroyInstance(instance_, nullptr);
}

VkPhysicalDevice VulkanHost::choose_device() const {
  uint32_t count = 16;
  VkPhysicalDevice devices[16];
  if (vkEnumeratePhysicalDevices(instance_, &count, devices) < 0 || count == 0) return VK_NULL_HANDLE;
  for (uint32_t i = 0; i < count; ++i) {
    VkPhysicalDeviceProperties properties;
    vkGetPhysicalDeviceProperties(devices[i], &properties);
    if (properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU) return devices[i];
  }
  return devices[0];
}

uint32_t VulkanHost::mappable_type(uint32_t allowed) const {
  constexpr VkMemoryPropertyFlags wanted = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
  VkPhysicalDeviceMemoryProperties memory;
  vkGetPhysicalDeviceMemoryProperties(physical_, &memory);
  for (uint32_t type = 0; type < memory.memoryTypeCount; ++type)
    if ((allowed >> type & 1) != 0 && (memory.memoryTypes[type].propertyFlags & wanted) == wanted) return type;
  ADD_FAILURE() << "the host's device has no memory that can be mapped";
  return 0;
}

void VulkanHost::lock(void* self, uint32_t locked) {
  auto* host = static_cast<VulkanHost*>(self);
  if (locked == 0) return host->queue_mutex_.unlock();
  host->queue_mutex_.lock();
  ++host->times_locked_;
}

VkBuffer VulkanHost::make_buffer(uint64_t bytes) {
  VkBufferCreateInfo info{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO};
  info.size = bytes, info.usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
  VkBuffer buffer = VK_NULL_HANDLE;
  EXPECT_EQ(vkCreateBuffer(device_, &info, nullptr, &buffer), VK_SUCCESS);
  return buffer;
}

VulkanHost::Memory VulkanHost::allocate(uint64_t bytes) {
  Memory made{make_buffer(bytes), VK_NULL_HANDLE, 0, 0, nullptr};
  VkMemoryRequirements needs;
  vkGetBufferMemoryRequirements(device_, made.buffer, &needs);
  made.bytes = needs.size;
  made.type = mappable_type(needs.memoryTypeBits);
  VkMemoryAllocateFlagsInfo flags{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO};
  flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
  VkMemoryAllocateInfo info{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, &flags};
  info.allocationSize = made.bytes, info.memoryTypeIndex = made.type;
  EXPECT_EQ(vkAllocateMemory(device_, &info, nullptr, &made.memory), VK_SUCCESS);
  EXPECT_EQ(vkBindBufferMemory(device_, made.buffer, made.memory, 0), VK_SUCCESS);
  EXPECT_EQ(vkMapMemory(device_, made.memory, 0, VK_WHOLE_SIZE, 0, reinterpret_cast<void**>(&made.mapped)), VK_SUCCESS);
  std::memset(made.mapped, 0, made.bytes);
  memories_.push_back(made);
  return made;
}

void VulkanHost::fill(VkDeviceMemory memory, uint64_t bytes, uint32_t word) {
  VkBuffer buffer = make_buffer(bytes);
  ASSERT_EQ(vkBindBufferMemory(device_, buffer, memory, 0), VK_SUCCESS);
  VkCommandPoolCreateInfo pool_info{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO};
  VkCommandPool pool = VK_NULL_HANDLE;
  ASSERT_EQ(vkCreateCommandPool(device_, &pool_info, nullptr, &pool), VK_SUCCESS);
  VkCommandBufferAllocateInfo allocate{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
  allocate.commandPool = pool, allocate.commandBufferCount = 1;
  VkCommandBuffer commands = VK_NULL_HANDLE;
  ASSERT_EQ(vkAllocateCommandBuffers(device_, &allocate, &commands), VK_SUCCESS);
  const VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
  vkBeginCommandBuffer(commands, &begin);
  vkCmdFillBuffer(commands, buffer, 0, VK_WHOLE_SIZE, word);
  vkEndCommandBuffer(commands);
  VkSubmitInfo submit{VK_STRUCTURE_TYPE_SUBMIT_INFO};
  submit.commandBufferCount = 1, submit.pCommandBuffers = &commands;
  {
    const std::lock_guard guard(queue_mutex_);
    ASSERT_EQ(vkQueueSubmit(queue_, 1, &submit, VK_NULL_HANDLE), VK_SUCCESS);
    ASSERT_EQ(vkQueueWaitIdle(queue_), VK_SUCCESS);
  }
  vkDestroyCommandPool(device_, pool, nullptr);
  vkDestroyBuffer(device_, buffer, nullptr);
}

VkSemaphore VulkanHost::timeline() {
  VkSemaphoreTypeCreateInfo type{VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO};
  type.semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE;
  const VkSemaphoreCreateInfo info{VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, &type};
  VkSemaphore made = VK_NULL_HANDLE;
  EXPECT_EQ(vkCreateSemaphore(device_, &info, nullptr, &made), VK_SUCCESS);
  timelines_.push_back(made);
  return made;
}

void VulkanHost::signal(VkSemaphore timeline, uint64_t value) {
  VkSemaphoreSignalInfo info{VK_STRUCTURE_TYPE_SEMAPHORE_SIGNAL_INFO};
  info.semaphore = timeline, info.value = value;
  EXPECT_EQ(vkSignalSemaphore(device_, &info), VK_SUCCESS);
}

bool VulkanHost::wait(VkSemaphore timeline, uint64_t value, uint64_t timeout_ns) {
  VkSemaphoreWaitInfo info{VK_STRUCTURE_TYPE_SEMAPHORE_WAIT_INFO};
  info.semaphoreCount = 1, info.pSemaphores = &timeline, info.pValues = &value;
  return vkWaitSemaphores(device_, &info, timeout_ns) == VK_SUCCESS;
}

}  // namespace ks::test
