// SPDX-License-Identifier: Apache-2.0
#include "depth/depth.h"

#include "rig/rig.h"

namespace simsense {

PixelRays::PixelRays(const Pinhole& camera, uint32_t width, uint32_t height) : x_(width), y_(height) {
  for (uint32_t x = 0; x < width; ++x) x_[x] = static_cast<float>((x - camera.cx) / camera.fx);
  for (uint32_t y = 0; y < height; ++y) y_[y] = static_cast<float>((y - camera.cy) / camera.fy);
}

PixelRays::PixelRays(const simsense_camera& camera) : PixelRays(pinhole(camera), camera.width, camera.height) {
  if (!is_distorting(camera.lens)) return;
  per_pixel_ = true;
  const size_t pixels = size_t{camera.width} * camera.height;
  x_.resize(pixels);
  y_.resize(pixels);
  for (uint32_t v = 0; v < camera.height; ++v)
    for (uint32_t u = 0; u < camera.width; ++u) {
      const auto [x, y] = ray_of_pixel(camera, u, v);
      x_[size_t{v} * camera.width + u] = static_cast<float>(x);
      y_[size_t{v} * camera.width + u] = static_cast<float>(y);
    }
}

}  // namespace simsense
