// SPDX-License-Identifier: Apache-2.0
// Arrays in device memory come in two kinds: tables, which grow and are rewritten in place, and blocks, which many small arrays share.
// Thread rule: externally synchronised.
#pragma once

#include <algorithm>
#include <cstring>
#include <memory>
#include <span>
#include <vector>

#include "device/buffer.h"

namespace kuafu {

/// The memory of the stages. On a device an address is a device address, on the host a pointer into the mapping.
struct Memory {
  std::shared_ptr<ks::Device> device;
  bool on_host = false;
  [[nodiscard]] uint64_t address(const ks::Buffer& buffer) const {
    return on_host ? reinterpret_cast<uint64_t>(buffer.mapped()) : buffer.address();
  }
};

/// Makes the buffer hold at least `words` of 32 bits; its content is lost when it grows.
inline void grow(const Memory& memory, std::shared_ptr<ks::Buffer>& buffer, uint64_t words) {
  const uint64_t bytes = std::max<uint64_t>(words, 1) * 4;
  if (buffer && buffer->size_bytes() >= bytes) return;
  buffer.reset();
  buffer = ks::Buffer::create(memory.device, bytes, memory.device->is_cpu() ? KS_BUFFER_HOST_VISIBLE : 0);
}

/// A table that the host writes through its mapping and never reads: small, rewritten often, without a staging copy.
template <class T>
class MappedTable {
 public:
  /// Returns room for `count` records; the content is lost when the table grows.
  std::span<T> resize(const Memory& memory, size_t count) {
    const uint64_t bytes = std::max<uint64_t>(count, 1) * sizeof(T);
    if (!buffer_ || buffer_->size_bytes() < bytes) buffer_ = ks::Buffer::create_table(memory.device, bytes);
    address_ = memory.address(*buffer_);
    return {static_cast<T*>(buffer_->mapped()), count};
  }
  /// Uploads elements [first, first + count) of `values`; all of them when the table grows.
  void write(const Memory& memory, const std::vector<T>& values, size_t first, size_t count) {
    if (!buffer_ || buffer_->size_bytes() < values.size() * sizeof(T)) {
      std::ranges::copy(values, resize(memory, values.size() + values.size() / 2).begin());
    } else if (count > 0) {
      std::copy_n(values.begin() + ptrdiff_t(first), count, static_cast<T*>(buffer_->mapped()) + first);
    }
  }
  [[nodiscard]] uint64_t address() const { return address_; }

 private:
  std::shared_ptr<ks::Buffer> buffer_;
  uint64_t address_ = 0;
};

/// Collects arrays for one allocation. `add` returns an offset from the uploaded buffer's address.
class Block {
 public:
  template <class T>
  uint64_t add(const std::vector<T>& values) {
    bytes_.resize((bytes_.size() + 15) / 16 * 16);
    const uint64_t offset = bytes_.size();
    if (values.empty()) return offset;
    bytes_.resize(offset + values.size() * sizeof(T));
    std::memcpy(bytes_.data() + offset, values.data(), values.size() * sizeof(T));
    return offset;
  }
  [[nodiscard]] std::shared_ptr<ks::Buffer> upload(const std::shared_ptr<ks::Device>& device) const {
    auto buffer = ks::Buffer::create_array(device, std::max<uint64_t>(bytes_.size(), 16));
    if (!bytes_.empty()) buffer->write(0, bytes_.data(), bytes_.size());
    return buffer;
  }

 private:
  std::vector<std::byte> bytes_;
};

}  // namespace kuafu
