// SPDX-License-Identifier: Apache-2.0
#include "cpu/rectify/remap.h"

#include <algorithm>
#include <cmath>

#include "device/thread_pool.h"

namespace simsense {
namespace {

template <class T>
const T* pixels(const ConstImage& image) {
  return reinterpret_cast<const T*>(image.data);
}

/// One pixel near or beyond the border, where taps may be missing.
template <class T>
float sample_border(const ConstImage& source, int width, int height, float sx, float sy) {
  const float x0 = std::floor(sx), y0 = std::floor(sy);
  const float fx = sx - x0, fy = sy - y0;
  const auto tap = [&](float x, float y) -> float {
    if (x < 0 || y < 0 || x > static_cast<float>(width - 1) || y > static_cast<float>(height - 1)) return 0;
    return pixels<T>(source)[static_cast<ptrdiff_t>(y) * source.row_stride + static_cast<ptrdiff_t>(x)];
  };
  const float top = (1 - fx) * tap(x0, y0) + fx * tap(x0 + 1, y0);
  const float bottom = (1 - fx) * tap(x0, y0 + 1) + fx * tap(x0 + 1, y0 + 1);
  return (1 - fy) * top + fy * bottom;
}

template <class T>
void remap_row(const RemapTable& table, const ConstImage& source, size_t y, T* out) {
  const float* map_x = table.x.data() + y * table.width;
  const float* map_y = table.y.data() + y * table.width;
  const float inner_x = static_cast<float>(table.width - 1), inner_y = static_cast<float>(table.height - 1);
  for (uint32_t x = 0; x < table.width; ++x) {
    const float sx = map_x[x], sy = map_y[x];
    float value = 0;
    if (sx >= 0 && sy >= 0 && sx < inner_x && sy < inner_y) {
      const auto ix = static_cast<ptrdiff_t>(sx), iy = static_cast<ptrdiff_t>(sy);
      const float fx = sx - static_cast<float>(ix), fy = sy - static_cast<float>(iy);
      const T* p = pixels<T>(source) + iy * source.row_stride + ix;
      const T* q = p + source.row_stride;
      value = (1 - fy) * ((1 - fx) * p[0] + fx * p[1]) + fy * ((1 - fx) * q[0] + fx * q[1]);
    } else if (sx > -1 && sy > -1 && sx < inner_x + 1 && sy < inner_y + 1) {
      value = sample_border<T>(source, static_cast<int>(table.width), static_cast<int>(table.height), sx, sy);
    }
    out[x] = static_cast<T>(std::lrint(value));
  }
}

template <class T>
void remap_nearest_row(const RemapTable& table, const ConstImage& source, size_t y, T* out) {
  const float last_x = static_cast<float>(table.width - 1), last_y = static_cast<float>(table.height - 1);
  for (size_t x = 0; x < table.width; ++x) {
    const size_t i = y * table.width + x;
    const auto sx = static_cast<ptrdiff_t>(std::clamp(std::round(table.x[i]), 0.0f, last_x));
    const auto sy = static_cast<ptrdiff_t>(std::clamp(std::round(table.y[i]), 0.0f, last_y));
    out[x] = pixels<T>(source)[sy * source.row_stride + sx];
  }
}

}  // namespace

void remap(const RemapTable& table, const ConstImage& source, void* out, ks::ThreadPool& workers) {
  workers.parallel_for(table.height, [&](size_t y) {
    if (source.element_bytes == 1) {
      remap_row(table, source, y, static_cast<uint8_t*>(out) + y * table.width);
    } else {
      remap_row(table, source, y, static_cast<uint16_t*>(out) + y * table.width);
    }
  });
}

void remap_nearest(const RemapTable& table, const ConstImage& source, void* out, ks::ThreadPool& workers) {
  workers.parallel_for(table.height, [&](size_t y) {
    if (source.element_bytes == 1) {
      remap_nearest_row(table, source, y, static_cast<uint8_t*>(out) + y * table.width);
    } else {
      remap_nearest_row(table, source, y, static_cast<uint16_t*>(out) + y * table.width);
    }
  });
}

}  // namespace simsense
