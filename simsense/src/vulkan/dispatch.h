// SPDX-License-Identifier: Apache-2.0
// Workgroups of the per-pixel stages, their buffers, and references to later images of a batch.
#pragma once

#include <memory>
#include <vector>

#include "device/buffer.h"
#include "device/compute.h"
#include "shared/image_ref.h"

namespace simsense {

inline uint32_t groups_of(uint64_t items, uint64_t per_group) { return static_cast<uint32_t>((items + per_group - 1) / per_group); }

/// Dispatches one invocation per pixel, in workgroups of 32 x 8, one layer per pair.
template <class Push>
void dispatch_pixels(ks::Commands& commands, const ks::ComputePipeline& pipeline, const Push& push, uint32_t width, uint32_t height,
                     uint32_t pairs) {
  commands.dispatch(pipeline, push, groups_of(width, 32), groups_of(height, 8), pairs);
}

/// Address of the first element of packed images.
inline uint64_t address_of(const ImageRef& packed) { return packed.address + uint64_t{packed.first} * ks_format_bytes(packed.format); }

inline ImageRef later_image(ImageRef image, uint32_t n) {
  image.first += n * static_cast<uint32_t>(image.batch_stride);
  return image;
}

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
