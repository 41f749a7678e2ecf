// SPDX-License-Identifier: Apache-2.0
// Plain arrays of the scalar reference: an image of per-pixel values, and a volume with one value per pixel and disparity.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace simsense::reference {

template <class T>
struct Grid {
  size_t width = 0, height = 0;
  std::vector<T> data;  // [height][width]
  Grid(size_t w, size_t h, T fill = T{}) : width(w), height(h), data(w * h, fill) {}
  T& at(size_t x, size_t y) { return data[y * width + x]; }
  [[nodiscard]] const T& at(size_t x, size_t y) const { return data[y * width + x]; }
};

template <class T>
struct Volume {
  size_t width = 0, height = 0, disparities = 0;
  std::vector<T> data;  // [height][width][disparities]
  Volume(size_t w, size_t h, size_t d) : width(w), height(h), disparities(d), data(w * h * d) {}
  T* at(size_t x, size_t y) { return &data[(y * width + x) * disparities]; }
  [[nodiscard]] const T* at(size_t x, size_t y) const { return &data[(y * width + x) * disparities]; }
};

}  // namespace simsense::reference
