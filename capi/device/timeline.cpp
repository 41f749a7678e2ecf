// SPDX-License-Identifier: Apache-2.0
#include "device/timeline.h"

#include "device/error.h"

namespace ks {

bool Timeline::can_have(const Device& device) {
  if (!device.has_vulkan()) return false;
  VkPhysicalDeviceVulkan12Features features{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES};
  VkPhysicalDeviceFeatures2 all{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &features};
  vkGetPhysicalDeviceFeatures2(device.physical(), &all);
  return features.timelineSemaphore == VK_TRUE;
}

Timeline::Timeline(std::shared_ptr<Device> device) : device_(std::move(device)) {
  if (!can_have(*device_)) fail(KS_ERROR_UNSUPPORTED, "%s has no timeline semaphores", device_->info().name);
  VkExportSemaphoreCreateInfo exportable{VK_STRUCTURE_TYPE_EXPORT_SEMAPHORE_CREATE_INFO};
  exportable.handleTypes = VK_EXTERNAL_SEMAPHORE_HANDLE_TYPE_OPAQUE_FD_BIT;
  VkSemaphoreTypeCreateInfo type{VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO};
  type.semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE;
  if (device_->info().capabilities & KS_CAP_TIMELINE_FD) type.pNext = &exportable;
  const VkSemaphoreCreateInfo info{VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, &type};
  check(device_->vk().vkCreateSemaphore(device_->handle(), &info, nullptr, &semaphore_), "vkCreateSemaphore");
}

Timeline::~Timeline() { device_->vk().vkDestroySemaphore(device_->handle(), semaphore_, nullptr); }

uint64_t Timeline::reached() const {
  uint64_t value = 0;
  check(device_->vk().vkGetSemaphoreCounterValue(device_->handle(), semaphore_, &value), "vkGetSemaphoreCounterValue");
  return value;
}

bool Timeline::wait(uint64_t value, uint64_t timeout_ns) const {
  VkSemaphoreWaitInfo info{VK_STRUCTURE_TYPE_SEMAPHORE_WAIT_INFO};
  info.semaphoreCount = 1;
  info.pSemaphores = &semaphore_;
  info.pValues = &value;
  const VkResult result = device_->vk().vkWaitSemaphores(device_->handle(), &info, timeout_ns);
  if (result == VK_TIMEOUT) return false;
  device_->check_alive(result, "vkWaitSemaphores");
  return true;
}

int Timeline::export_fd() const {
  if (!(device_->info().capabilities & KS_CAP_TIMELINE_FD))
    fail(KS_ERROR_UNSUPPORTED, "%s cannot export timeline semaphores (KS_CAP_TIMELINE_FD)", device_->info().name);
  VkSemaphoreGetFdInfoKHR info{VK_STRUCTURE_TYPE_SEMAPHORE_GET_FD_INFO_KHR};
  info.semaphore = semaphore_;
  info.handleType = VK_EXTERNAL_SEMAPHORE_HANDLE_TYPE_OPAQUE_FD_BIT;
  int fd = -1;
  check(device_->vk().vkGetSemaphoreFdKHR(device_->handle(), &info, &fd), "vkGetSemaphoreFdKHR");
  return fd;
}

}  // namespace ks
