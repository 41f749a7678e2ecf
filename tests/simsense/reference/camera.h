// SPDX-License-Identifier: Apache-2.0
// What follows from the cameras, double precision, one pixel after the other.
#pragma once

#include <array>
#include <vector>

#include "depth/depth.h"
#include "rectify/rectification.h"

namespace simsense::reference {

// Rectification written from the camera model: each rectified pixel's ray is rotated back, distorted (Brown-Conrady) and projected; double
// precision.
/// Pixel of the source camera that the rectified pixel (u, v) sees. source_to_rectified: R1 or R2.
std::array<double, 2> rectified_to_source(const simsense_camera& source, const Rotation& source_to_rectified, const Pinhole& rectified,
                                          double u, double v);

/// Bilinear value at (x, y) of a packed image; taps outside are 0.
double bilinear(const uint8_t* image, uint32_t width, uint32_t height, double x, double y);

// Distortion, depth, registration and points written from the camera model, double precision, one pixel after the other.
/// Brown-Conrady, as OpenCV's documentation of the pinhole camera gives it: radial k1, k2, k3 and tangential p1, p2 on normalised
/// coordinates.
std::array<double, 2> distort(const simsense_camera& camera, double x, double y);

double depth(const StereoGeometry& geometry, double disparity);

/// Where a point of the rectified left camera lies in the RGB camera: {column, row, z}; column and row are not rounded.
std::array<double, 3> project_to_rgb(const StereoGeometry& geometry, const simsense_camera& rgb, const Rigid& left_to_rgb, double u,
                                     double v, double z);

/// Each point covers splat_size x splat_size pixels about the nearest one (an even size reaches one further left and up); the nearest point
/// wins.
std::vector<float> register_to_rgb(const StereoGeometry& geometry, uint32_t width, uint32_t height, const simsense_camera& rgb,
                                   const Rigid& left_to_rgb, const std::vector<float>& depth, const DepthRange& range, uint32_t splat_size);

}  // namespace simsense::reference
