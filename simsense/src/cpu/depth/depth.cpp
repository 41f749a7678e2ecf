// SPDX-License-Identifier: Apache-2.0
#include "cpu/depth/depth.h"

namespace simsense {

void depth_from_disparity(const StereoGeometry& geometry, const DepthRange& range, const float* disparity, float invalid, uint32_t width,
                          uint32_t height, float* depth, ks::ThreadPool& workers) {
  const float focal_baseline = static_cast<float>(geometry.camera.fx * geometry.baseline_m);  // pixels * metres
  const float offset = static_cast<float>(geometry.disparity_offset_px);
  workers.parallel_for(height, [&](size_t y) {
    for (size_t i = y * width; i < (y + 1) * width; ++i) {
      const float parallax = disparity[i] + offset;
      const bool measured = disparity[i] > invalid && parallax > 0;
      depth[i] = measured ? range.keep(focal_baseline / parallax) : 0;
    }
  });
}

void make_points(const PixelRays& rays, const float* depth, uint32_t width, uint32_t height, const Plane& points,
                 ptrdiff_t component_stride, ks::ThreadPool& workers) {
  const bool per_pixel = rays.is_per_pixel();
  workers.parallel_for(height, [&](size_t row) {
    const auto y = static_cast<uint32_t>(row);
    for (uint32_t x = 0; x < width; ++x) {
      const size_t pixel = row * width + x;
      const float z = depth[pixel];
      const Plane point{points.data + x * points.pixel_stride + static_cast<ptrdiff_t>(y) * points.row_stride, 0, component_stride};
      point.set(0, 0, z * rays.x()[per_pixel ? pixel : x]);
      point.set(1, 0, z * rays.y()[per_pixel ? pixel : y]);
      point.set(2, 0, z);
    }
  });
}

void color_points(const float* depth, uint32_t width, uint32_t height, const ConstPlane& rgb, ptrdiff_t rgb_component_stride,
                  const Plane& points, ptrdiff_t component_stride, ks::ThreadPool& workers) {
  workers.parallel_for(height, [&](size_t row) {
    const auto y = static_cast<uint32_t>(row);
    for (uint32_t x = 0; x < width; ++x) {
      const Plane point{points.data + x * points.pixel_stride + static_cast<ptrdiff_t>(y) * points.row_stride, 0, component_stride};
      for (uint32_t c = 0; c < 3; ++c) {
        const ConstPlane channel{rgb.data + static_cast<ptrdiff_t>(c) * rgb_component_stride, rgb.row_stride, rgb.pixel_stride, rgb.format};
        point.set(3 + c, 0, depth[row * width + x] > 0 ? static_cast<float>(channel.at<uint8_t>(x, y)) / 255.0f : 0.0f);
      }
    }
  });
}

}  // namespace simsense
