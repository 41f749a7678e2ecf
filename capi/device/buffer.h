// SPDX-License-Identifier: Apache-2.0
// Linear memory: a VkBuffer with its device address, or plain host memory on the host device. Export and import by file descriptor, host
// pointer or Vulkan handle (ks/buffer.h). Shared by reference; keeps its device alive. Thread rule: externally synchronised contents,
// immutable object.
#pragma once

#include <memory>
#include <mutex>

#include "device/device.h"
#include "ks/buffer.h"
#include "ks/image.h"

namespace ks {

class Buffer {
 public:
  /// Makes a zero-filled buffer for storage, transfers and indirect commands, with a device address. Host-visible memory is coherent, and
  /// cached if the device has such a type.
  /// extra_usage: further usage flags, for acceleration structures; such a buffer cannot be exported.
  static std::shared_ptr<Buffer> create(std::shared_ptr<Device> device, uint64_t size_bytes, uint32_t flags /* KS_BUFFER_* */,
                                        VkBufferUsageFlags extra_usage = 0);
  /// Makes a buffer for tables that the host writes and only the device reads: always mapped, in the device's own memory if that can be
  /// mapped.
  static std::shared_ptr<Buffer> create_table(const std::shared_ptr<Device>& device, uint64_t size_bytes);
  /// Makes a buffer for arrays that the host changes in parts and only the device reads. It lies in the device's own memory, and is mapped
  /// if enough of that can be mapped: a write is then a store, without a submission.
  static std::shared_ptr<Buffer> create_array(const std::shared_ptr<Device>& device, uint64_t size_bytes,
                                              VkBufferUsageFlags extra_usage = 0);
  static std::shared_ptr<Buffer> import(std::shared_ptr<Device> device, const ks_buffer_desc& desc);
  ~Buffer();
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;

  [[nodiscard]] ks_buffer_desc export_as(uint32_t memory) const;
  [[nodiscard]] uint64_t size_bytes() const { return size_bytes_; }
  [[nodiscard]] VkBuffer handle() const { return buffer_; }
  /// Device address for buffer_reference in shaders; 0 on the host device.
  [[nodiscard]] uint64_t address() const { return address_; }
  /// Host address; nullptr if the memory is not host visible.
  [[nodiscard]] void* mapped() const { return mapped_; }
  [[nodiscard]] const std::shared_ptr<Device>& device() const { return device_; }

  /// Copies data to or from the buffer; copied_bytes() counts it. Memory that the host cannot see is reached through a staging buffer. A
  /// buffer that is read keeps its own: making one takes longer than copying an image. Throws for a range outside the buffer.
  void write(uint64_t offset_bytes, const void* data, uint64_t size_bytes);
  void read(uint64_t offset_bytes, void* data, uint64_t size_bytes) const;

 private:
  Buffer() = default;
  static std::shared_ptr<Buffer> make(std::shared_ptr<Device> device, uint64_t size_bytes, uint32_t flags, VkBufferUsageFlags extra_usage,
                                      VkMemoryPropertyFlags preferred);
  void check_range(uint64_t offset_bytes, uint64_t size_bytes, const char* what) const;
  /// Returns host-visible memory to copy through, in pieces if size_bytes is large: the kept buffer, or a new one if that is too small or
  /// in use.
  [[nodiscard]] std::shared_ptr<Buffer> take_staging(uint64_t size_bytes) const;
  void keep_staging(std::shared_ptr<Buffer> staging) const;
  void allocate_host();
  void allocate_vulkan(VkMemoryPropertyFlags preferred);
  /// Allocates host-lent memory on a CPU device.
  void allocate_lent();
  /// Takes zero-filled memory from the host.
  void take_lent(uint64_t bytes, uint64_t alignment);
  void import_host(const ks_buffer_desc& desc);
  void import_host_pages(const ks_buffer_desc& desc);
  void import_fd(const ks_buffer_desc& desc, VkExternalMemoryHandleTypeFlagBits handle_type);
  void import_vulkan(const ks_buffer_desc& desc);
  [[nodiscard]] uint32_t dma_buf_type(int fd, const VkMemoryRequirements& needs) const;
  /// Vulkan's handle type of the exported memory; 0 if the buffer cannot be exported.
  [[nodiscard]] VkExternalMemoryHandleTypeFlagBits exported_handle_type() const;
  VkMemoryRequirements make_vk_buffer(VkExternalMemoryHandleTypeFlags handle_types);
  void allocate_memory(uint64_t bytes, uint32_t type, bool dedicated, const void* chain);
  void bind(uint64_t offset_bytes);
  void map();
  void clear();

  std::shared_ptr<Device> device_;
  VkBuffer buffer_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  uint64_t size_bytes_ = 0, allocation_bytes_ = 0, owned_bytes_ = 0, address_ = 0;
  uint32_t memory_type_ = 0, flags_ = 0;
  VkBufferUsageFlags extra_usage_ = 0;
  bool owns_host_ = false, owns_memory_ = true;
  void* mapped_ = nullptr;
  void* lent_ = nullptr;  // by the host
  uint64_t lent_bytes_ = 0, lent_alignment_ = 0;
  mutable std::mutex staging_mutex_;
  mutable std::shared_ptr<Buffer> staging_;
};

/// Throws KS_ERROR_INVALID_ARGUMENT unless the view lies inside size_bytes; overflow-safe. Returns {first, one past last} byte touched.
struct ByteRange {
  uint64_t begin, end;
};
ByteRange check_image(const ks_image_desc& image, uint64_t size_bytes, const char* name);

}  // namespace ks
