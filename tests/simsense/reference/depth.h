// SPDX-License-Identifier: Apache-2.0
// Distortion, depth, registration and points written from the camera model, double precision, one pixel after the other.
#pragma once

#include <array>
#include <vector>

#include "depth/depth.h"
#include "rectify/rectification.h"

namespace simsense::reference {

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
