// SPDX-License-Identifier: Apache-2.0
// The layout of an image argument: shape and strides, checked against the call's needs; and the images of a call. Plain values.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include "device/buffer.h"
#include "ks/image.h"
#include "simsense/simsense.h"

namespace simsense {

/// A strided view of a buffer, or of the caller's memory if there is no buffer.
struct ImageArgument {
  std::shared_ptr<ks::Buffer> buffer;
  void* host = nullptr;
  ks_image_desc image{};
};

/// The shape that an image must have: [batch][height][width] or [batch][height][width][channels]. The batch dimension may be missing if it
/// is 1.
struct ImageShape {
  uint64_t batch = 1, height = 0, width = 0, channels = 0;  // channels 0: no such dimension
};

/// An image's strides in bytes; 0 for missing dimensions.
struct ImageLayout {
  ks_image_desc image{};
  ImageShape shape;
  ptrdiff_t batch_stride = 0, row_stride = 0, pixel_stride = 0, component_stride = 0;

  [[nodiscard]] bool has_packed_rows() const {
    const auto element = static_cast<ptrdiff_t>(ks_format_bytes(image.format));
    return component_stride == 0 && pixel_stride == element && row_stride == element * static_cast<ptrdiff_t>(shape.width);
  }
};

/// Throws KS_ERROR_INVALID_ARGUMENT with `name` first, unless the argument has this shape and memory that holds it: a buffer of the
/// engine's device, or a host pointer.
ImageLayout check_layout(const ks::Device& device, const ImageArgument& argument, const ImageShape& shape, const char* name);

constexpr uint32_t output_count = SIMSENSE_OUTPUT_POINTS_COLORED + 1;

/// A range of a batch's pairs.
struct Pairs {
  uint32_t first = 0, count = 0;
};

/// The images of one compute call, inputs and outputs, as a back end reaches them (cpu/frame.h, vulkan/frame.h).
template <class Image>
struct FrameOf {
  std::optional<Image> inputs[2];
  std::optional<Image> lasers[2];
  std::optional<Image> rgb;
  std::array<std::optional<Image>, output_count> outputs;

  [[nodiscard]] bool wants(uint32_t output) const { return outputs[output].has_value(); }
  [[nodiscard]] bool wants_points() const { return wants(SIMSENSE_OUTPUT_POINTS) || wants(SIMSENSE_OUTPUT_POINTS_COLORED); }
  [[nodiscard]] bool wants_disparity() const {
    return wants(SIMSENSE_OUTPUT_DISPARITY) || wants(SIMSENSE_OUTPUT_DEPTH) || wants(SIMSENSE_OUTPUT_DEPTH_RGB) || wants_points() ||
           wants(SIMSENSE_OUTPUT_CONFIDENCE) || wants(SIMSENSE_OUTPUT_REASON);
  }
};

}  // namespace simsense
