// SPDX-License-Identifier: Apache-2.0
// A table that stays on the device.
#pragma once

#include <memory>
#include <vector>

#include "device/buffer.h"

namespace simsense {

inline std::shared_ptr<ks::Buffer> upload(const std::shared_ptr<ks::Device>& device, const std::vector<float>& values) {
  auto buffer = ks::Buffer::create(device, values.size() * sizeof(float), 0);
  buffer->write(0, values.data(), values.size() * sizeof(float));
  return buffer;
}

/// Makes the buffer hold at least `bytes`; a larger one is kept.
inline void reserve(const std::shared_ptr<ks::Device>& device, std::shared_ptr<ks::Buffer>& buffer, uint64_t bytes) {
  if (!buffer || buffer->size_bytes() < bytes) buffer = ks::Buffer::create(device, bytes, 0);
}

}  // namespace simsense
