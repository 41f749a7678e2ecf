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

/// Computes the points of a depth image. depth: packed [height][width], metres. points: address of pixel (0, 0)'s x; component_stride:
/// bytes from x to y to z.
void make_points(const PixelRays& rays, const float* depth, uint32_t width, uint32_t height, const Plane& points,
                 ptrdiff_t component_stride, ks::ThreadPool& workers);
/// Writes each point's components 3..5: red, green and blue (0..1) of its pixel in an 8-bit image, or 0 without depth.
void color_points(const float* depth, uint32_t width, uint32_t height, const ConstPlane& rgb, ptrdiff_t rgb_component_stride,
                  const Plane& points, ptrdiff_t component_stride, ks::ThreadPool& workers);

}  // namespace simsense
