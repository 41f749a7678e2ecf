// SPDX-License-Identifier: Apache-2.0
// Export and import of buffers: what crosses between two libraries is a plain ks_buffer_desc (ks/buffer.h).
#include <fcntl.h>
#include <sys/stat.h>

#include <cstring>

#include "device/buffer.h"
#include "device/error.h"
#include "device/host_memory.h"
#include "device/owned_fd.h"

namespace ks {
namespace {

using ull = unsigned long long;

void check_extent(const ks_buffer_desc& desc) {
  if (desc.size_bytes == 0) fail(KS_ERROR_INVALID_ARGUMENT, "buffer import: size_bytes is 0");
  if (desc.offset_bytes > desc.allocation_bytes || desc.size_bytes > desc.allocation_bytes - desc.offset_bytes)
    fail(KS_ERROR_INVALID_ARGUMENT, "buffer import: %llu bytes at offset %llu leave the allocation of %llu bytes",
         static_cast<ull>(desc.size_bytes), static_cast<ull>(desc.offset_bytes), static_cast<ull>(desc.allocation_bytes));
}

void check_same_device(const ks_buffer_desc& desc, const ks_device_info& info) {
  if (std::memcmp(desc.device_uuid, info.device_uuid, sizeof desc.device_uuid) != 0 ||
      std::memcmp(desc.driver_uuid, info.driver_uuid, sizeof desc.driver_uuid) != 0)
    fail(KS_ERROR_INVALID_ARGUMENT,
         "buffer import: the memory belongs to another device or driver than %s: an opaque fd is valid only between equal UUIDs; use "
         "KS_MEMORY_HOST",
         info.name);
}

/// Memory behind a regular file (lavapipe) shorter than the descriptor says would fault when touched. GPU drivers' fds are no regular
/// files.
void check_memory_fd(int fd, const ks_buffer_desc& desc) {
  struct stat status {};
  if (fstat(fd, &status) != 0) return;
  if (S_ISFIFO(status.st_mode) || S_ISSOCK(status.st_mode) || S_ISDIR(status.st_mode) || S_ISBLK(status.st_mode))
    fail(KS_ERROR_INVALID_ARGUMENT, "buffer import: fd %llu is a pipe, socket, folder or disk, not memory", static_cast<ull>(desc.handle));
  if (S_ISREG(status.st_mode) && static_cast<uint64_t>(status.st_size) < desc.allocation_bytes)
    fail(KS_ERROR_INVALID_ARGUMENT, "buffer import: fd %llu holds %llu bytes, the descriptor says %llu", static_cast<ull>(desc.handle),
         static_cast<ull>(status.st_size), static_cast<ull>(desc.allocation_bytes));
}

void check_memory_type(uint32_t index, const VkPhysicalDeviceMemoryProperties& memory, const VkMemoryRequirements& needs) {
  if (index >= memory.memoryTypeCount || !(needs.memoryTypeBits >> index & 1u))
    fail(KS_ERROR_INVALID_ARGUMENT, "buffer import: memory type %u cannot hold a buffer (allowed bits 0x%x)", index, needs.memoryTypeBits);
}

void check_fits(const ks_buffer_desc& desc, const VkMemoryRequirements& needs) {
  const bool fits = desc.dedicated ? desc.offset_bytes == 0 && desc.allocation_bytes == needs.size
                                   : desc.offset_bytes % needs.alignment == 0 && needs.size <= desc.allocation_bytes - desc.offset_bytes;
  if (!fits)
    fail(KS_ERROR_INVALID_ARGUMENT,
         "buffer import: %s allocation of %llu bytes, offset %llu, does not fit a buffer that needs %llu bytes aligned to %llu",
         desc.dedicated ? "a dedicated" : "an", static_cast<ull>(desc.allocation_bytes), static_cast<ull>(desc.offset_bytes),
         static_cast<ull>(needs.size), static_cast<ull>(needs.alignment));
}

/// A handle of KS_MEMORY_HOST is an address.
void* host_address(uint64_t handle) {
  return reinterpret_cast<void*>(static_cast<uintptr_t>(handle));  // NOLINT(performance-no-int-to-ptr)
}

}  // namespace

std::shared_ptr<Buffer> Buffer::import(std::shared_ptr<Device> device, const ks_buffer_desc& desc) {
  check_extent(desc);
  std::shared_ptr<Buffer> self(new Buffer);
  self->device_ = std::move(device);
  self->size_bytes_ = desc.size_bytes;
  switch (desc.memory) {
    case KS_MEMORY_HOST:
      self->import_host(desc);
      break;
    case KS_MEMORY_OPAQUE_FD:
      if (!(self->device_->info().capabilities & KS_CAP_IMPORT_OPAQUE_FD))
        fail(KS_ERROR_UNSUPPORTED, "%s cannot import memory by opaque fd: share by KS_MEMORY_HOST", self->device_->info().name);
      check_same_device(desc, self->device_->info());
      self->import_fd(desc, VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT);
      break;
    case KS_MEMORY_DMA_BUF:
      if (!(self->device_->info().capabilities & KS_CAP_IMPORT_DMA_BUF))
        fail(KS_ERROR_UNSUPPORTED, "%s cannot import memory by dma-buf (KS_CAP_IMPORT_DMA_BUF)", self->device_->info().name);
      self->import_fd(desc, VK_EXTERNAL_MEMORY_HANDLE_TYPE_DMA_BUF_BIT_EXT);
      break;
    case KS_MEMORY_VULKAN:
      self->import_vulkan(desc);
      break;
    default:
      fail(KS_ERROR_INVALID_ARGUMENT, "buffer import: memory is %u, which is no KS_MEMORY_*", desc.memory);
  }
  return self;
}

void Buffer::import_host(const ks_buffer_desc& desc) {
  if (desc.handle == 0 || desc.handle > UINT64_MAX - desc.allocation_bytes)
    fail(KS_ERROR_INVALID_ARGUMENT, "buffer import: host pointer 0x%llx with %llu bytes", static_cast<ull>(desc.handle),
         static_cast<ull>(desc.allocation_bytes));
  if (device_->has_vulkan()) import_host_pages(desc);
  mapped_ = host_address(desc.handle + desc.offset_bytes);
  allocation_bytes_ = desc.allocation_bytes - desc.offset_bytes;
}

void Buffer::import_host_pages(const ks_buffer_desc& desc) {
  const uint64_t alignment = device_->host_pointer_alignment();
  if (alignment == 0) fail(KS_ERROR_UNSUPPORTED, "%s cannot import host pointers (no VK_EXT_external_memory_host)", device_->info().name);
  const VkMemoryRequirements needs = make_vk_buffer(VK_EXTERNAL_MEMORY_HANDLE_TYPE_HOST_ALLOCATION_BIT_EXT);
  // Whole pages around the buffer are imported; a page that holds one byte of the caller's memory is mapped to its end.
  const uint64_t begin = desc.handle + desc.offset_bytes;
  const uint64_t first_page = begin / alignment * alignment;
  const uint64_t last_page = (begin + needs.size + alignment - 1) / alignment * alignment;
  const uint64_t offset = begin - first_page;
  const uint64_t end = (desc.handle + desc.allocation_bytes + page_bytes() - 1) / page_bytes() * page_bytes();
  if (offset % needs.alignment != 0 || last_page > end || (first_page < desc.handle && alignment > page_bytes()))
    fail(KS_ERROR_INVALID_ARGUMENT,
         "buffer import: host memory 0x%llx + %llu of %llu bytes does not suit %s, which needs pointers aligned to %llu bytes in "
         "allocations of whole "
         "multiples of %llu",
         static_cast<ull>(desc.handle), static_cast<ull>(desc.offset_bytes), static_cast<ull>(desc.allocation_bytes), device_->info().name,
         static_cast<ull>(needs.alignment), static_cast<ull>(alignment));
  void* pages = host_address(first_page);
  constexpr auto handle_type = VK_EXTERNAL_MEMORY_HANDLE_TYPE_HOST_ALLOCATION_BIT_EXT;
  VkMemoryHostPointerPropertiesEXT properties{VK_STRUCTURE_TYPE_MEMORY_HOST_POINTER_PROPERTIES_EXT};
  check(device_->vk().vkGetMemoryHostPointerPropertiesEXT(device_->handle(), handle_type, pages, &properties),
        "buffer import: the device does not take this host pointer (vkGetMemoryHostPointerPropertiesEXT)");
  VkImportMemoryHostPointerInfoEXT import{VK_STRUCTURE_TYPE_IMPORT_MEMORY_HOST_POINTER_INFO_EXT};
  import.handleType = handle_type;
  import.pHostPointer = pages;
  memory_type_ = device_->memory_type(needs.memoryTypeBits & properties.memoryTypeBits, 0, VK_MEMORY_PROPERTY_HOST_COHERENT_BIT);
  allocate_memory(last_page - first_page, memory_type_, false, &import);
  bind(offset);
}

void Buffer::import_fd(const ks_buffer_desc& desc, VkExternalMemoryHandleTypeFlagBits handle_type) {
  OwnedFd fd(desc.handle);
  check_memory_fd(fd.get(), desc);
  const VkMemoryRequirements needs = make_vk_buffer(handle_type);
  memory_type_ = handle_type == VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT ? desc.memory_type_index : dma_buf_type(fd.get(), needs);
  check_memory_type(memory_type_, device_->memory_properties(), needs);
  check_fits(desc, needs);
  VkImportMemoryFdInfoKHR import{VK_STRUCTURE_TYPE_IMPORT_MEMORY_FD_INFO_KHR};
  import.handleType = handle_type;
  import.fd = fd.get();
  allocate_memory(desc.allocation_bytes, memory_type_, desc.dedicated != 0, &import);
  fd.release();
  bind(desc.offset_bytes);
  map();
  if (mapped_ != nullptr) mapped_ = static_cast<char*>(mapped_) + desc.offset_bytes;
  allocation_bytes_ -= desc.offset_bytes;
}

uint32_t Buffer::dma_buf_type(int fd, const VkMemoryRequirements& needs) const {
  VkMemoryFdPropertiesKHR properties{VK_STRUCTURE_TYPE_MEMORY_FD_PROPERTIES_KHR};
  check(device_->vk().vkGetMemoryFdPropertiesKHR(device_->handle(), VK_EXTERNAL_MEMORY_HANDLE_TYPE_DMA_BUF_BIT_EXT, fd, &properties),
        "buffer import: the fd is no dma-buf (vkGetMemoryFdPropertiesKHR)");
  return device_->memory_type(needs.memoryTypeBits & properties.memoryTypeBits, 0, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
}

void Buffer::import_vulkan(const ks_buffer_desc& desc) {
  if (!device_->is_hosts())
    fail(KS_ERROR_UNSUPPORTED,
         "buffer import: KS_MEMORY_VULKAN belongs to a VkDevice, and %s was not made from the host's (KS_SELECT_VULKAN)",
         device_->info().name);
  if (desc.handle == 0) fail(KS_ERROR_INVALID_ARGUMENT, "buffer import: the VkDeviceMemory is NULL");
  const VkMemoryRequirements needs = make_vk_buffer(0);
  check_memory_type(desc.memory_type_index, device_->memory_properties(), needs);
  check_fits(desc, needs);
  memory_type_ = desc.memory_type_index;
  memory_ = reinterpret_cast<VkDeviceMemory>(static_cast<uintptr_t>(desc.handle));  // NOLINT(performance-no-int-to-ptr)
  owns_memory_ = false;
  allocation_bytes_ = desc.allocation_bytes - desc.offset_bytes;
  bind(desc.offset_bytes);  // not mapped: the host may have mapped it, and memory is mapped once
}

ks_buffer_desc Buffer::export_as(uint32_t memory) const {
  ks_buffer_desc desc = ks_buffer_desc_init();
  desc.memory = memory;
  desc.memory_type_index = memory_type_;
  desc.allocation_bytes = allocation_bytes_;
  desc.size_bytes = size_bytes_;
  std::memcpy(desc.device_uuid, device_->info().device_uuid, sizeof desc.device_uuid);
  std::memcpy(desc.driver_uuid, device_->info().driver_uuid, sizeof desc.driver_uuid);
  if (memory == KS_MEMORY_HOST) {
    if (mapped_ == nullptr)
      fail(KS_ERROR_INVALID_STATE, "the buffer is not host visible: create it with KS_BUFFER_HOST_VISIBLE to export it as KS_MEMORY_HOST");
    desc.handle = reinterpret_cast<uintptr_t>(mapped_);
    return desc;
  }
  if (memory == KS_MEMORY_VULKAN) {
    if (!device_->is_hosts() || !owns_memory_)
      fail(KS_ERROR_INVALID_STATE,
           "KS_MEMORY_VULKAN is the memory of a buffer that was created on a device that the host has made (KS_SELECT_VULKAN)");
    desc.handle = reinterpret_cast<uintptr_t>(memory_);
    desc.dedicated = flags_ & (KS_BUFFER_EXPORTABLE | KS_BUFFER_DMA_BUF) ? 1 : 0;
    return desc;
  }
  const bool dma_buf = memory == KS_MEMORY_DMA_BUF;
  if (memory != KS_MEMORY_OPAQUE_FD && !dma_buf)
    fail(KS_ERROR_INVALID_ARGUMENT, "buffer export: memory is %u, which is no KS_MEMORY_*", memory);
  if (!(flags_ & (dma_buf ? KS_BUFFER_DMA_BUF : KS_BUFFER_EXPORTABLE)))
    fail(KS_ERROR_INVALID_STATE, "the buffer was not created with %s (an imported buffer never is): it cannot be exported as %s",
         dma_buf ? "KS_BUFFER_DMA_BUF" : "KS_BUFFER_EXPORTABLE", dma_buf ? "a dma-buf" : "an opaque fd");
  VkMemoryGetFdInfoKHR info{VK_STRUCTURE_TYPE_MEMORY_GET_FD_INFO_KHR};
  info.memory = memory_;
  info.handleType = exported_handle_type();
  int fd = -1;
  check(device_->vk().vkGetMemoryFdKHR(device_->handle(), &info, &fd), "vkGetMemoryFdKHR");
  fcntl(fd, F_SETFD, FD_CLOEXEC);
  desc.handle = static_cast<uint64_t>(fd);
  desc.dedicated = 1;
  return desc;
}

}  // namespace ks
