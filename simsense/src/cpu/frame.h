// SPDX-License-Identifier: Apache-2.0
// The images of one compute call in the host's memory, and outputs as the caller wants them. A stage writes straight into the caller's
// memory where that is packed and of the stage's own type, else into scratch that is converted and scattered afterwards. Thread rule:
// externally synchronised.
#pragma once

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "image/layout.h"
#include "image/view.h"
#include "signal/imager.h"

namespace simsense {

/// An image argument of a compute call made reachable by the host: in place where the memory is mapped or the caller's own, else through a
/// counted copy.
class HostImage {
 public:
  /// Checks shape, bounds and pointers; throws KS_ERROR_INVALID_ARGUMENT with `name` first. Reads a buffer that is not mapped.
  HostImage(const ks::Device& device, const ImageArgument& argument, const ImageShape& shape, const char* name);

  [[nodiscard]] uint32_t format() const { return layout_.image.format; }
  [[nodiscard]] ConstPlane input(uint32_t batch_index) const;
  [[nodiscard]] Plane output(uint32_t batch_index) const;
  [[nodiscard]] ptrdiff_t component_stride() const { return layout_.component_stride; }
  /// Whether a stage may write the image directly: packed rows of one-component, aligned elements.
  [[nodiscard]] bool is_packed() const;
  /// Copies an output back to its buffer if that is not mapped.
  void commit();

 private:
  void reach_buffer(const char* name);

  ImageLayout layout_;
  std::shared_ptr<ks::Buffer> buffer_;
  std::byte* first_ = nullptr;  // element (0, 0, 0)
  std::vector<std::byte> staging_;
  uint64_t staging_begin_ = 0;
};

template <class T>
constexpr uint32_t format_of = sizeof(T) == 1   ? KS_FORMAT_U8
                               : sizeof(T) == 2 ? KS_FORMAT_U16
                                                : KS_FORMAT_F32;

/// Rounds metres to millimetres; 0 if the type cannot hold them.
template <class T>
T to_millimetres(float z_m) {
  const float mm = std::rint(z_m * 1000.0f);
  return mm <= static_cast<float>(std::numeric_limits<T>::max()) ? static_cast<T>(mm) : T{0};
}

/// Converts pixels to OpenCV's fixed point with four fractional bits.
inline int16_t to_sixteenths(float disparity_px) { return static_cast<int16_t>(std::lrint(disparity_px * 16.0f)); }

struct HostFrame : FrameOf<HostImage> {
  /// Returns the memory that a stage writes: the caller's if it is packed and of type T, else `scratch`.
  template <class T>
  T* target(uint32_t output, uint32_t batch_index, std::vector<T>& scratch, size_t pixels) const {
    if (wants(output) && outputs[output]->is_packed() && outputs[output]->format() == format_of<T>)
      return reinterpret_cast<T*>(outputs[output]->output(batch_index).data);
    scratch.resize(pixels);
    return scratch.data();
  }

  /// Copies a stage's rows to the caller's image, unless the stage wrote there.
  template <class T>
  void store(uint32_t output, uint32_t batch_index, const T* from, ptrdiff_t row_stride, uint32_t width, uint32_t height) const {
    if (wants(output) && static_cast<const void*>(from) != outputs[output]->output(batch_index).data)
      scatter(output, batch_index, from, row_stride, width, height, [](T value) { return value; });
  }
  /// Copies counts; images of 8 bits lack the extra ones.
  void store_counts(uint32_t output, uint32_t batch_index, const uint16_t* from, ptrdiff_t row_stride, uint32_t width, uint32_t height,
                    uint32_t extra_bits) const {
    if (extra_bits == 0 || (wants(output) && outputs[output]->format() == KS_FORMAT_U16)) {
      store(output, batch_index, from, row_stride, width, height);
    } else if (wants(output)) {
      scatter(output, batch_index, from, row_stride, width, height, [=](uint16_t count) { return image_count(count, extra_bits); });
    }
  }
  /// Copies packed depths, metres, to the caller's image in its format.
  void store_depth(uint32_t output, uint32_t batch_index, const float* from, uint32_t width, uint32_t height) const {
    const uint32_t format = wants(output) ? outputs[output]->format() : 0;
    if (format == KS_FORMAT_F32) store(output, batch_index, from, width, width, height);
    if (format == KS_FORMAT_U16) scatter(output, batch_index, from, width, width, height, to_millimetres<uint16_t>);
    if (format == KS_FORMAT_I16) scatter(output, batch_index, from, width, width, height, to_millimetres<int16_t>);
  }
  void store_disparity(uint32_t batch_index, const float* from, uint32_t width, uint32_t height) const {
    const uint32_t format = wants(SIMSENSE_OUTPUT_DISPARITY) ? outputs[SIMSENSE_OUTPUT_DISPARITY]->format() : 0;
    if (format == KS_FORMAT_F32) store(SIMSENSE_OUTPUT_DISPARITY, batch_index, from, width, width, height);
    if (format == KS_FORMAT_I16) scatter(SIMSENSE_OUTPUT_DISPARITY, batch_index, from, width, width, height, to_sixteenths);
  }

 private:
  template <class T, class Convert>
  void scatter(uint32_t output, uint32_t batch_index, const T* from, ptrdiff_t row_stride, uint32_t width, uint32_t height,
               Convert convert) const {
    const Plane to = outputs[output]->output(batch_index);
    for (uint32_t y = 0; y < height; ++y)
      for (uint32_t x = 0; x < width; ++x) to.set(x, y, convert(from[static_cast<ptrdiff_t>(y) * row_stride + x]));
  }
};

}  // namespace simsense
