// SPDX-License-Identifier: Apache-2.0
// Disparity to depth to points on the host.
// Thread rule: pure functions; the result does not depend on the number of workers.
#pragma once

#include "depth/depth.h"
#include "device/thread_pool.h"
#include "image/view.h"
#include "rectify/rectification.h"

namespace simsense {

/// Converts disparities to depth. disparity: packed [height][width], pixels; `invalid` and smaller values are invalid. depth: packed
/// [height][width], metres, 0 = invalid; may be the same memory.
void depth_from_disparity(const StereoGeometry& geometry, const DepthRange& range, const float* disparity, float invalid, uint32_t width,
                          uint32_t height, float* depth, ks::ThreadPool& workers);

/// Computes the points of a depth image: (x, y, z) = z * ray(pixel), 0,0,0 where there is no depth. depth: packed [height][width], metres.
/// points: address of pixel (0, 0)'s x; component_stride: bytes from x to y to z.
void make_points(const PixelRays& rays, const float* depth, uint32_t width, uint32_t height, const Plane& points,
                 ptrdiff_t component_stride, ks::ThreadPool& workers);
/// Writes each point's components 3..5: red, green and blue (0..1) of its pixel in an 8-bit image, or 0 without depth.
void color_points(const float* depth, uint32_t width, uint32_t height, const ConstPlane& rgb, ptrdiff_t rgb_component_stride,
                  const Plane& points, ptrdiff_t component_stride, ks::ThreadPool& workers);

}  // namespace simsense
