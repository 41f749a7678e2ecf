// SPDX-License-Identifier: Apache-2.0
#include "device/buffer.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "device/compute.h"
#include "device/error.h"
#include "device/host_memory.h"
#include "device/interrupt.h"
#include "device/physical.h"

namespace ks {
namespace {

using ull = unsigned long long;

constexpr uint64_t staging_bytes = 64ull << 20;  // per copy to or from memory the host does not see
constexpr VkMemoryPropertyFlags host_coherent = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;

}  // namespace

std::shared_ptr<Buffer> Buffer::create(std::shared_ptr<Device> device, uint64_t size_bytes, uint32_t flags,
                                       VkBufferUsageFlags extra_usage) {
  constexpr uint32_t known = KS_BUFFER_EXPORTABLE | KS_BUFFER_HOST_VISIBLE | KS_BUFFER_DMA_BUF,
                     shared = KS_BUFFER_EXPORTABLE | KS_BUFFER_DMA_BUF;
  if (size_bytes == 0) fail(KS_ERROR_INVALID_ARGUMENT, "a buffer of 0 bytes was asked for: the smallest is 1");
  if (flags & ~known) fail(KS_ERROR_INVALID_ARGUMENT, "buffer flags 0x%x hold bits that are not KS_BUFFER_* (0x%x)", flags, known);
  if ((flags & KS_BUFFER_EXPORTABLE) && !(device->info().capabilities & KS_CAP_EXPORT_OPAQUE_FD))
    fail(KS_ERROR_UNSUPPORTED, "%s cannot export memory as an opaque fd: leave KS_BUFFER_EXPORTABLE out and share by KS_MEMORY_HOST",
         device->info().name);
  if ((flags & KS_BUFFER_DMA_BUF) && !(device->info().capabilities & KS_CAP_EXPORT_DMA_BUF))
    fail(KS_ERROR_UNSUPPORTED, "%s cannot export memory as a dma-buf (KS_CAP_EXPORT_DMA_BUF)", device->info().name);
  if ((flags & shared) == shared)
    fail(KS_ERROR_INVALID_ARGUMENT, "buffer flags: KS_BUFFER_EXPORTABLE and KS_BUFFER_DMA_BUF are for buffers of their own");
  if ((flags & shared) && extra_usage != 0)
    fail(KS_ERROR_INTERNAL, "a buffer with usage 0x%x beyond that of every buffer cannot be exported", extra_usage);
  const bool host = (flags & KS_BUFFER_HOST_VISIBLE) || device->is_cpu();
  return make(std::move(device), size_bytes, flags, extra_usage,
              host ? VK_MEMORY_PROPERTY_HOST_CACHED_BIT : VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
}

std::shared_ptr<Buffer> Buffer::create_table(const std::shared_ptr<Device>& device, uint64_t size_bytes) {
  try {
    return make(device, size_bytes, KS_BUFFER_HOST_VISIBLE, 0, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
  } catch (const Error&) {  // such memory may be a small window, and full
    return create(device, size_bytes, KS_BUFFER_HOST_VISIBLE);
  }
}

std::shared_ptr<Buffer> Buffer::create_array(const std::shared_ptr<Device>& device, uint64_t size_bytes, VkBufferUsageFlags extra_usage) {
  if (!device->is_cpu() && size_bytes <= device->mappable_bytes() / 8) {  // without resizable BAR the window is small, and shared by all
    try {
      return make(device, size_bytes, KS_BUFFER_HOST_VISIBLE, extra_usage, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
    } catch (const Error&) {  // it is full
    }
  }
  return create(device, size_bytes, 0, extra_usage);
}

std::shared_ptr<Buffer> Buffer::make(std::shared_ptr<Device> device, uint64_t size_bytes, uint32_t flags, VkBufferUsageFlags extra_usage,
                                     VkMemoryPropertyFlags preferred) {
  std::shared_ptr<Buffer> self(new Buffer);
  self->device_ = std::move(device);
  self->size_bytes_ = size_bytes;
  self->flags_ = flags;
  self->extra_usage_ = extra_usage;
  if (self->device_->has_vulkan())
    self->allocate_vulkan(preferred);
  else
    self->allocate_host();
  self->owned_bytes_ = self->allocation_bytes_;
  self->device_->count_allocated(int64_t(self->owned_bytes_));
  return self;
}

void Buffer::allocate_host() {
  if (size_bytes_ > physical_memory_bytes())
    fail(KS_ERROR_OUT_OF_HOST_MEMORY, "a buffer of %llu bytes does not fit the host's %llu bytes of memory", static_cast<ull>(size_bytes_),
         static_cast<ull>(physical_memory_bytes()));
  const uint64_t page = page_bytes();
  allocation_bytes_ = (size_bytes_ + page - 1) / page * page;
  if (device_->host_memory() != nullptr)
    take_lent(allocation_bytes_, page);
  else
    mapped_ = map_host_pages(allocation_bytes_);
  owns_host_ = true;
}

void Buffer::take_lent(uint64_t bytes, uint64_t alignment) {
  lent_ = device_->host_memory()->allocate(bytes, alignment);
  lent_bytes_ = bytes;
  lent_alignment_ = alignment;
  std::memset(lent_, 0, bytes);
  mapped_ = lent_;
}

void Buffer::allocate_lent() {
  const uint64_t alignment = std::max(device_->host_pointer_alignment(), page_bytes());
  const uint64_t heap_bytes = physical_memory_bytes();
  if (size_bytes_ > heap_bytes)
    fail(KS_ERROR_OUT_OF_DEVICE_MEMORY, "a buffer of %llu bytes does not fit the host's %llu bytes of memory",
         static_cast<ull>(size_bytes_), static_cast<ull>(heap_bytes));
  take_lent((size_bytes_ + alignment - 1) / alignment * alignment, alignment);
  ks_buffer_desc desc = ks_buffer_desc_init();
  desc.memory = KS_MEMORY_HOST;
  desc.handle = reinterpret_cast<uintptr_t>(lent_);
  desc.allocation_bytes = desc.size_bytes = lent_bytes_;
  import_host_pages(desc);
}

void Buffer::allocate_vulkan(VkMemoryPropertyFlags preferred) {
  const VkExternalMemoryHandleTypeFlags exported = exported_handle_type();
  if (exported == 0 && device_->is_cpu() && device_->host_memory() != nullptr && device_->host_pointer_alignment() != 0)
    return allocate_lent();
  const bool host = (flags_ & KS_BUFFER_HOST_VISIBLE) || device_->is_cpu();
  const VkMemoryRequirements needs = make_vk_buffer(exported);
  memory_type_ = device_->memory_type(needs.memoryTypeBits, host ? host_coherent : 0, preferred);
  VkExportMemoryAllocateInfo export_info{VK_STRUCTURE_TYPE_EXPORT_MEMORY_ALLOCATE_INFO};
  export_info.handleTypes = exported;
  allocate_memory(needs.size, memory_type_, exported != 0, exported != 0 ? &export_info : nullptr);
  bind(0);
  map();
  clear();
}

VkExternalMemoryHandleTypeFlagBits Buffer::exported_handle_type() const {
  if (flags_ & KS_BUFFER_DMA_BUF) return VK_EXTERNAL_MEMORY_HANDLE_TYPE_DMA_BUF_BIT_EXT;
  return flags_ & KS_BUFFER_EXPORTABLE ? VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT : VkExternalMemoryHandleTypeFlagBits(0);
}

VkMemoryRequirements Buffer::make_vk_buffer(VkExternalMemoryHandleTypeFlags handle_types) {
  // Rounded up so that fills and copies in words reach the last byte. Exporter and importer round alike: a dedicated allocation needs equal
  // buffers.
  constexpr uint64_t granule = 16;
  if (size_bytes_ > UINT64_MAX - granule)
    fail(KS_ERROR_OUT_OF_DEVICE_MEMORY, "a buffer of %llu bytes is too large", static_cast<ull>(size_bytes_));
  VkExternalMemoryBufferCreateInfo external{VK_STRUCTURE_TYPE_EXTERNAL_MEMORY_BUFFER_CREATE_INFO};
  external.handleTypes = handle_types;
  VkBufferCreateInfo info{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO, handle_types != 0 ? &external : nullptr};
  info.size = (size_bytes_ + granule - 1) / granule * granule;
  info.usage = buffer_usage | extra_usage_;
  check(device_->vk().vkCreateBuffer(device_->handle(), &info, nullptr, &buffer_), "vkCreateBuffer");
  VkMemoryRequirements needs{};
  device_->vk().vkGetBufferMemoryRequirements(device_->handle(), buffer_, &needs);
  return needs;
}

void Buffer::allocate_memory(uint64_t bytes, uint32_t type, bool dedicated, const void* chain) {
  const VkPhysicalDeviceMemoryProperties& memory = device_->memory_properties();
  const uint64_t heap_bytes = memory.memoryHeaps[memory.memoryTypes[type].heapIndex].size;
  // Asked before the driver is: lavapipe would take any size and be killed when it is used.
  if (bytes > heap_bytes)
    fail(KS_ERROR_OUT_OF_DEVICE_MEMORY, "a buffer of %llu bytes does not fit the %llu bytes of memory type %u of %s",
         static_cast<ull>(size_bytes_), static_cast<ull>(heap_bytes), type, device_->info().name);
  VkMemoryAllocateFlagsInfo flags{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO, chain};
  flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
  VkMemoryDedicatedAllocateInfo dedicated_info{VK_STRUCTURE_TYPE_MEMORY_DEDICATED_ALLOCATE_INFO, &flags};
  dedicated_info.buffer = buffer_;
  VkMemoryAllocateInfo info{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO};
  info.pNext = dedicated ? static_cast<const void*>(&dedicated_info) : &flags;
  info.allocationSize = bytes;
  info.memoryTypeIndex = type;
  const VkResult result = device_->vk().vkAllocateMemory(device_->handle(), &info, nullptr, &memory_);
  check(result, ("vkAllocateMemory of " + std::to_string(bytes) + " bytes, memory type " + std::to_string(type)).c_str());
  allocation_bytes_ = bytes;
}

void Buffer::bind(uint64_t offset_bytes) {
  check(device_->vk().vkBindBufferMemory(device_->handle(), buffer_, memory_, offset_bytes), "vkBindBufferMemory");
  VkBufferDeviceAddressInfo info{VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO};
  info.buffer = buffer_;
  address_ = device_->vk().vkGetBufferDeviceAddress(device_->handle(), &info);
}

void Buffer::map() {
  const VkMemoryPropertyFlags flags = device_->memory_properties().memoryTypes[memory_type_].propertyFlags;
  if ((flags & host_coherent) != host_coherent) return;
  check(device_->vk().vkMapMemory(device_->handle(), memory_, 0, VK_WHOLE_SIZE, 0, &mapped_), "vkMapMemory");
}

void Buffer::clear() {
  if (mapped_ != nullptr) {
    constexpr uint64_t piece_bytes = 32ull << 20;  // of memory that was never touched some 20 ms
    for (uint64_t done = 0; done < allocation_bytes_; done += piece_bytes) {
      interruption_point();
      std::memset(static_cast<char*>(mapped_) + done, 0, std::min(piece_bytes, allocation_bytes_ - done));
    }
    return;
  }
  Commands commands(device_);
  device_->vk().vkCmdFillBuffer(commands.handle(), buffer_, 0, VK_WHOLE_SIZE, 0);
  commands.flush();
}

Buffer::~Buffer() {
  if (owned_bytes_ > 0) device_->count_allocated(-int64_t(owned_bytes_));
  if (owns_host_ && lent_ == nullptr) unmap_host_pages(mapped_, allocation_bytes_);
  if (buffer_ != VK_NULL_HANDLE) device_->vk().vkDestroyBuffer(device_->handle(), buffer_, nullptr);
  if (owns_memory_ && memory_ != VK_NULL_HANDLE) device_->vk().vkFreeMemory(device_->handle(), memory_, nullptr);
  if (lent_ != nullptr) device_->host_memory()->deallocate(lent_, lent_bytes_, lent_alignment_);
}

void Buffer::check_range(uint64_t offset_bytes, uint64_t size_bytes, const char* what) const {
  if (offset_bytes > size_bytes_ || size_bytes > size_bytes_ - offset_bytes)
    fail(KS_ERROR_INVALID_ARGUMENT, "%s of %llu bytes at offset %llu leaves the buffer of %llu bytes", what, static_cast<ull>(size_bytes),
         static_cast<ull>(offset_bytes), static_cast<ull>(size_bytes_));
}

void Buffer::write(uint64_t offset_bytes, const void* data, uint64_t size_bytes) {
  check_range(offset_bytes, size_bytes, "a write");
  if (size_bytes == 0) return;
  if (data == nullptr) fail(KS_ERROR_INVALID_ARGUMENT, "a write of %llu bytes from NULL", static_cast<ull>(size_bytes));
  if (mapped_ != nullptr) {
    std::memmove(static_cast<char*>(mapped_) + offset_bytes, data, size_bytes);  // data may lie in this very memory
    device_->count_copy(size_bytes);
    return;
  }
  std::unique_lock lock(staging_mutex_);
  const bool was_read = staging_ != nullptr;
  lock.unlock();
  const auto staging = take_staging(size_bytes);
  Commands commands(device_);
  for (uint64_t done = 0; done < size_bytes; done += staging->size_bytes()) {
    const uint64_t bytes = std::min(staging->size_bytes(), size_bytes - done);
    std::memcpy(staging->mapped(), static_cast<const char*>(data) + done, bytes);
    commands.copy(*staging, 0, *this, offset_bytes + done, bytes);
    commands.flush();
  }
  if (was_read) keep_staging(staging);
}

void Buffer::read(uint64_t offset_bytes, void* data, uint64_t size_bytes) const {
  check_range(offset_bytes, size_bytes, "a read");
  if (size_bytes == 0) return;
  if (data == nullptr) fail(KS_ERROR_INVALID_ARGUMENT, "a read of %llu bytes to NULL", static_cast<ull>(size_bytes));
  if (mapped_ != nullptr) {
    std::memmove(data, static_cast<const char*>(mapped_) + offset_bytes, size_bytes);
    device_->count_copy(size_bytes);
    return;
  }
  const auto staging = take_staging(size_bytes);
  Commands commands(device_);
  for (uint64_t done = 0; done < size_bytes; done += staging->size_bytes()) {
    const uint64_t bytes = std::min(staging->size_bytes(), size_bytes - done);
    commands.copy(*this, offset_bytes + done, *staging, 0, bytes);
    commands.flush();
    std::memcpy(static_cast<char*>(data) + done, staging->mapped(), bytes);
  }
  keep_staging(staging);
}

std::shared_ptr<Buffer> Buffer::take_staging(uint64_t size_bytes) const {
  const uint64_t bytes = std::min(size_bytes, staging_bytes);
  {
    const std::lock_guard lock(staging_mutex_);
    if (staging_ != nullptr && staging_->size_bytes() >= bytes) return std::exchange(staging_, nullptr);
  }
  return create(device_, bytes, KS_BUFFER_HOST_VISIBLE);
}

void Buffer::keep_staging(std::shared_ptr<Buffer> staging) const {
  const std::lock_guard lock(staging_mutex_);
  staging_.swap(staging);
}

}  // namespace ks
