// SPDX-License-Identifier: Apache-2.0
// Depth image to points: (x, y, z) = z * ray(pixel), 0,0,0 where there is no depth.
// Thread rule: pure functions; the result does not depend on the number of workers.
#pragma once

#include "depth/rays.h"
#include "image/view.h"

namespace ks {
class ThreadPool;
}

namespace simsense {

/// depth: packed [height][width] metres. points: the x of pixel (0, 0); component_stride is from x to y to z, in bytes.
void make_points(const PixelRays& rays, const float* depth, uint32_t width, uint32_t height, const Plane& points,
                 ptrdiff_t component_stride, ks::ThreadPool& workers);
/// Components 3..5 of each point: red, green, blue of the same pixel of an 8-bit image, 0..1; 0 where there is no depth.
void color_points(const float* depth, uint32_t width, uint32_t height, const ConstPlane& rgb, ptrdiff_t rgb_component_stride,
                  const Plane& points, ptrdiff_t component_stride, ks::ThreadPool& workers);

}  // namespace simsense
