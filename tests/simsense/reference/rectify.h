// SPDX-License-Identifier: Apache-2.0
// Rectification written from the camera model: each rectified pixel's ray is rotated back, distorted (Brown-Conrady) and projected; double
// precision.
#pragma once

#include <array>

#include "rectify/rectification.h"

namespace simsense::reference {

/// Pixel of the source camera that the rectified pixel (u, v) sees. source_to_rectified: R1 or R2.
std::array<double, 2> rectified_to_source(const simsense_camera& source, const Rotation& source_to_rectified, const Pinhole& rectified,
                                          double u, double v);

/// Bilinear value at (x, y) of a packed image; taps outside are 0.
double bilinear(const uint8_t* image, uint32_t width, uint32_t height, double x, double y);

}  // namespace simsense::reference
