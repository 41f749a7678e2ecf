// SPDX-License-Identifier: Apache-2.0
#include "accel/array_buffer.h"

#include <cstring>
#include <optional>

#include "device/compute.h"
#include "device/interrupt.h"

namespace kuafu {
namespace {

constexpr uint64_t piece_bytes = 32ull << 20;  // into memory that was never touched some 20 ms

}  // namespace

void ArrayBuffer::write_bytes(uint64_t offset_bytes, const std::byte* values, uint64_t bytes) {
  for (uint64_t done = 0; done < bytes; done += piece_bytes) {
    ks::interruption_point();
    buffer_->write(offset_bytes + done, values + done, std::min(piece_bytes, bytes - done));
  }
}

/// Neighbours go together, and all of them in one submission.
void ArrayBuffer::write_elements(const std::byte* values, uint64_t element_bytes, std::vector<uint32_t> indices) {
  if (indices.empty()) return;
  std::ranges::sort(indices);
  indices.erase(std::unique(indices.begin(), indices.end()), indices.end());
  std::vector<ks::ByteRange> ranges;
  for (const uint32_t i : indices) {
    const uint64_t begin = i * element_bytes;
    if (ranges.empty() || ranges.back().end != begin) ranges.push_back({begin, begin});
    ranges.back().end = begin + element_bytes;
  }
  std::shared_ptr<ks::Buffer> staging;
  if (!buffer_->mapped()) staging = ks::Buffer::create(buffer_->device(), indices.size() * element_bytes, KS_BUFFER_HOST_VISIBLE);
  std::optional<ks::Commands> commands;
  uint64_t staged = 0;
  for (const auto& [begin, end] : ranges) {
    if (!staging) {
      buffer_->write(begin, values + begin, end - begin);
      continue;
    }
    if (!commands) commands.emplace(buffer_->device()).set_automatic_barriers(false);
    std::memcpy(static_cast<std::byte*>(staging->mapped()) + staged, values + begin, end - begin);
    commands->copy(*staging, staged, *buffer_, begin, end - begin);
    staged += end - begin;
  }
  if (commands) commands->flush();
}

}  // namespace kuafu
