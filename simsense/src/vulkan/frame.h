// SPDX-License-Identifier: Apache-2.0
// The images of one compute call in the device's memory.
#pragma once

#include <optional>

#include "image/frame.h"
#include "vulkan/image.h"

namespace simsense {

using DeviceFrame = FrameOf<DeviceImage>;

inline ImageRef ref_or_none(const std::optional<DeviceImage>& image, const Pairs& pairs) {
  return image ? image->ref(pairs.first) : ImageRef{};
}

/// Returns the image if a stage can use it as its own array: packed, and of the stage's format; else nothing.
inline std::optional<ImageRef> packed_ref(const std::optional<DeviceImage>& image, const Pairs& pairs, uint32_t format) {
  if (!image || image->format() != format || !image->is_packed()) return std::nullopt;
  return image->ref(pairs.first);
}

}  // namespace simsense
