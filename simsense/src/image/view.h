// SPDX-License-Identifier: Apache-2.0
// Strided views of one image plane in host memory, as the stages read and write them. Strides are in bytes and may be negative.
#pragma once

#include <cstddef>
#include <cstdint>

namespace simsense {

struct ConstPlane {
  const std::byte* data = nullptr;
  ptrdiff_t row_stride = 0, pixel_stride = 0;
  uint32_t format = 0;  // KS_FORMAT_*

  template <class T>
  [[nodiscard]] T at(uint32_t x, uint32_t y) const {
    T value;
    __builtin_memcpy(&value, data + static_cast<ptrdiff_t>(y) * row_stride + static_cast<ptrdiff_t>(x) * pixel_stride, sizeof(T));
    return value;
  }
};

struct Plane {
  std::byte* data = nullptr;
  ptrdiff_t row_stride = 0, pixel_stride = 0;

  template <class T>
  void set(uint32_t x, uint32_t y, T value) const {
    __builtin_memcpy(data + static_cast<ptrdiff_t>(y) * row_stride + static_cast<ptrdiff_t>(x) * pixel_stride, &value, sizeof(T));
  }
};

}  // namespace simsense
