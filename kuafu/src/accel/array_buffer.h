// SPDX-License-Identifier: Apache-2.0
// One array in device memory, grown when needed, else written in place, as a whole or the elements that changed.
// Thread rule: externally synchronised.
#pragma once

#include <algorithm>
#include <memory>
#include <span>
#include <vector>

#include "device/buffer.h"

namespace kuafu {

class ArrayBuffer {
 public:
  enum class Writer { host, device };
  explicit ArrayBuffer(VkBufferUsageFlags extra_usage = 0, Writer writer = Writer::host) : extra_usage_(extra_usage), writer_(writer) {}

  /// Makes room for `bytes`; the content is lost when the buffer grows.
  void reserve(const std::shared_ptr<ks::Device>& device, uint64_t bytes) {
    if (buffer_ && buffer_->size_bytes() >= bytes) return;
    bytes = std::max<uint64_t>(bytes, 16);
    buffer_ = writer_ == Writer::host ? ks::Buffer::create_array(device, bytes, extra_usage_)
                                      : ks::Buffer::create(device, bytes, 0, extra_usage_);
  }
  template <class T>
  void upload(const std::shared_ptr<ks::Device>& device, const std::vector<T>& values) {
    reserve(device, values.size() * sizeof(T));
    write(0, values);
  }
  template <class T>
  void write(uint64_t offset_bytes, const std::vector<T>& values) {
    write_bytes(offset_bytes, reinterpret_cast<const std::byte*>(values.data()), values.size() * sizeof(T));
  }
  /// Uploads the changed ones of `values`, by their indices in any order; all of them when the array grows.
  template <class T>
  void upload_changed(const std::shared_ptr<ks::Device>& device, const std::vector<T>& values, std::vector<uint32_t> indices) {
    if (!buffer_ || buffer_->size_bytes() < values.size() * sizeof(T)) {
      reserve(device, (values.size() + values.size() / 2) * sizeof(T));
      write(0, values);
    } else {
      write_elements(reinterpret_cast<const std::byte*>(values.data()), sizeof(T), std::move(indices));
    }
  }
  [[nodiscard]] uint64_t address() const { return buffer_ ? buffer_->address() : 0; }
  [[nodiscard]] uint64_t size_bytes() const { return buffer_ ? buffer_->size_bytes() : 0; }
  [[nodiscard]] const std::shared_ptr<ks::Buffer>& buffer() const { return buffer_; }

 private:
  void write_bytes(uint64_t offset_bytes, const std::byte* values, uint64_t bytes);
  void write_elements(const std::byte* values, uint64_t element_bytes, std::vector<uint32_t> indices);

  VkBufferUsageFlags extra_usage_;
  Writer writer_;
  std::shared_ptr<ks::Buffer> buffer_;
};

}  // namespace kuafu
