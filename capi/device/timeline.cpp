// SPDX-License-Identifier: Apache-2.0
#include "device/timeline.h"

#include "device/error.h"
#include "device/interrupt.h"
#include "device/owned_fd.h"
#include "device/struct_read.h"
#include "device/struct_table.h"

namespace ks {

bool Timeline::can_have(const Device& device) { return device.has_vulkan() && device.features12().timelineSemaphore == VK_TRUE; }

Timeline::Timeline(std::shared_ptr<Device> device) : device_(std::move(device)) {
  make((device_->info().capabilities & KS_CAP_TIMELINE_FD) != 0);
}

Timeline::Timeline(std::shared_ptr<Device> device, const ks_sync& sync) : device_(std::move(device)) {
  if (sync.kind == KS_SYNC_TIMELINE_FD) {
    import_fd(sync.handle);
    return;
  }
  if (sync.kind != KS_SYNC_SEMAPHORE)
    fail(KS_ERROR_INVALID_ARGUMENT, "sync: kind is %u, another's timeline is KS_SYNC_TIMELINE_FD (1) or KS_SYNC_SEMAPHORE (3)", sync.kind);
  if (!device_->is_hosts())
    fail(KS_ERROR_UNSUPPORTED, "sync: a KS_SYNC_SEMAPHORE belongs to a VkDevice, and %s was not made from the host's (KS_SELECT_VULKAN)",
         device_->info().name);
  if (!can_have(*device_)) fail(KS_ERROR_UNSUPPORTED, "%s has no timeline semaphores", device_->info().name);
  if (sync.handle == 0) fail(KS_ERROR_INVALID_ARGUMENT, "sync: the VkSemaphore is NULL");
  semaphore_ = reinterpret_cast<VkSemaphore>(static_cast<uintptr_t>(sync.handle));  // NOLINT(performance-no-int-to-ptr)
  owned_ = false;
}

void Timeline::make(bool exportable) {
  if (!can_have(*device_)) fail(KS_ERROR_UNSUPPORTED, "%s has no timeline semaphores", device_->info().name);
  VkExportSemaphoreCreateInfo export_info{VK_STRUCTURE_TYPE_EXPORT_SEMAPHORE_CREATE_INFO};
  export_info.handleTypes = VK_EXTERNAL_SEMAPHORE_HANDLE_TYPE_OPAQUE_FD_BIT;
  VkSemaphoreTypeCreateInfo type{VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO};
  type.semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE;
  if (exportable) type.pNext = &export_info;
  const VkSemaphoreCreateInfo info{VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, &type};
  check(device_->vk().vkCreateSemaphore(device_->handle(), &info, nullptr, &semaphore_), "vkCreateSemaphore");
}

void Timeline::import_fd(uint64_t fd) {
  if (!(device_->info().capabilities & KS_CAP_TIMELINE_FD))
    fail(KS_ERROR_UNSUPPORTED, "%s cannot import timeline semaphores (KS_CAP_TIMELINE_FD)", device_->info().name);
  OwnedFd copy(fd);
  make(false);
  VkImportSemaphoreFdInfoKHR info{VK_STRUCTURE_TYPE_IMPORT_SEMAPHORE_FD_INFO_KHR};
  info.semaphore = semaphore_;
  info.handleType = VK_EXTERNAL_SEMAPHORE_HANDLE_TYPE_OPAQUE_FD_BIT;
  info.fd = copy.get();
  const VkResult result = device_->vk().vkImportSemaphoreFdKHR(device_->handle(), &info);
  if (result != VK_SUCCESS) device_->vk().vkDestroySemaphore(device_->handle(), semaphore_, nullptr);
  check(result, "sync: the fd is no timeline semaphore (vkImportSemaphoreFdKHR)");
  copy.release();
}

Timeline::~Timeline() {
  if (owned_) device_->vk().vkDestroySemaphore(device_->handle(), semaphore_, nullptr);
}

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

void Timeline::signal(uint64_t value) const {
  VkSemaphoreSignalInfo info{VK_STRUCTURE_TYPE_SEMAPHORE_SIGNAL_INFO};
  info.semaphore = semaphore_;
  info.value = value;
  device_->check_alive(device_->vk().vkSignalSemaphore(device_->handle(), &info), "vkSignalSemaphore");
}

ks_sync Timeline::exported(uint64_t value) const {
  ks_sync sync = ks_sync_init();
  sync.kind = device_->is_hosts() ? KS_SYNC_SEMAPHORE : KS_SYNC_TIMELINE_FD;
  sync.handle = device_->is_hosts() ? reinterpret_cast<uintptr_t>(semaphore_) : static_cast<uint64_t>(export_fd());
  sync.value = value;
  return sync;
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

void TimelinePoint::wait_on_host() const {
  constexpr uint64_t slice_ns = 20'000'000;  // between the looks whether the call is to end
  while (timeline && !timeline->wait(value, slice_ns)) interruption_point();
}

TimelinePoint point_of(const std::shared_ptr<Device>& device, const ks_sync* sync) {
  if (sync == nullptr) return {};
  const ks_sync known = read_struct(sync, KS_TYPE_SYNC, "wait");
  if (known.kind == KS_SYNC_HOST) return {};
  return {std::make_shared<const Timeline>(device, known), known.value};
}

}  // namespace ks
