// SPDX-License-Identifier: Apache-2.0
#include "simsense/reference/camera.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace simsense::reference {

std::array<double, 2> rectified_to_source(const simsense_camera& source, const Rotation& source_to_rectified, const Pinhole& rectified,
                                          double u, double v) {
  const Rotation& r = source_to_rectified;
  const double ray[3] = {(u - rectified.cx) / rectified.fx, (v - rectified.cy) / rectified.fy, 1};
  double in_source[3];
  for (int i = 0; i < 3; ++i) in_source[i] = r[i] * ray[0] + r[3 + i] * ray[1] + r[6 + i] * ray[2];  // transposed rotation
  const auto [x, y] = distort(source, in_source[0] / in_source[2], in_source[1] / in_source[2]);
  return {source.k[0] * x + source.k[2], source.k[4] * y + source.k[5]};
}

double bilinear(const uint8_t* image, uint32_t width, uint32_t height, double x, double y) {
  double sum = 0;
  for (int dy = 0; dy < 2; ++dy)
    for (int dx = 0; dx < 2; ++dx) {
      const double tap_x = std::floor(x) + dx, tap_y = std::floor(y) + dy;
      if (tap_x < 0 || tap_y < 0 || tap_x >= width || tap_y >= height) continue;
      const double weight = (1 - std::abs(x - tap_x)) * (1 - std::abs(y - tap_y));
      sum += weight * image[static_cast<size_t>(tap_y) * width + static_cast<size_t>(tap_x)];
    }
  return sum;
}

std::array<double, 2> distort(const simsense_camera& camera, double x, double y) {
  const double k1 = camera.lens.distortion[0], k2 = camera.lens.distortion[1], p1 = camera.lens.distortion[2],
               p2 = camera.lens.distortion[3], k3 = camera.lens.distortion[4], k4 = camera.lens.distortion[5],
               k5 = camera.lens.distortion[6], k6 = camera.lens.distortion[7];
  const double r2 = x * x + y * y;
  const double radial = (1 + k1 * r2 + k2 * r2 * r2 + k3 * r2 * r2 * r2) / (1 + k4 * r2 + k5 * r2 * r2 + k6 * r2 * r2 * r2);
  return {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
}

double depth(const StereoGeometry& geometry, double disparity) {
  const double parallax = disparity + geometry.disparity_offset_px;
  return disparity < 0 || parallax <= 0 ? 0 : geometry.camera.fx * geometry.baseline_m / parallax;
}

std::array<double, 3> project_to_rgb(const StereoGeometry& geometry, const simsense_camera& rgb, const Rigid& left_to_rgb, double u,
                                     double v, double z) {
  const Pinhole& k = geometry.camera;
  const Rotation& r = geometry.left_to_rectified;
  const std::array<double, 3> rectified{z * (u - k.cx) / k.fx, z * (v - k.cy) / k.fy, z};
  std::array<double, 3> left{}, seen = left_to_rgb.translation;
  for (size_t i = 0; i < 3; ++i)
    for (size_t j = 0; j < 3; ++j) left[i] += r[3 * j + i] * rectified[j];
  for (size_t i = 0; i < 3; ++i)
    for (size_t j = 0; j < 3; ++j) seen[i] += left_to_rgb.rotation[3 * i + j] * left[j];
  const auto [x, y] = distort(rgb, seen[0] / seen[2], seen[1] / seen[2]);
  return {rgb.k[0] * x + rgb.k[2], rgb.k[4] * y + rgb.k[5], seen[2]};
}

std::vector<float> register_to_rgb(const StereoGeometry& geometry, uint32_t width, uint32_t height, const simsense_camera& rgb,
                                   const Rigid& left_to_rgb, const std::vector<float>& depth, const DepthRange& range,
                                   uint32_t splat_size) {
  constexpr double nothing = std::numeric_limits<double>::infinity();
  std::vector<double> nearest(size_t{rgb.width} * rgb.height, nothing);
  for (uint32_t v = 0; v < height; ++v)
    for (uint32_t u = 0; u < width; ++u) {
      const double z = depth[size_t{v} * width + u];
      if (z <= 0) continue;
      const auto [column, row, z_rgb] = project_to_rgb(geometry, rgb, left_to_rgb, u, v, z);
      const double x = std::floor(column + 0.5), y = std::floor(row + 0.5);
      if (z_rgb <= 0) continue;
      for (uint32_t k = 0; k < splat_size * splat_size; ++k) {
        const uint32_t half = splat_size / 2, column_of_splat = k % splat_size, row_of_splat = k / splat_size;
        const double covered_x = x - half + column_of_splat, covered_y = y - half + row_of_splat;
        if (covered_x < 0 || covered_y < 0 || covered_x >= rgb.width || covered_y >= rgb.height) continue;
        double& cell = nearest[static_cast<size_t>(covered_y) * rgb.width + static_cast<size_t>(covered_x)];
        cell = std::min(cell, z_rgb);
      }
    }
  std::vector<float> out(nearest.size());
  for (size_t i = 0; i < out.size(); ++i) out[i] = std::isinf(nearest[i]) ? 0 : range.keep(static_cast<float>(nearest[i]));
  return out;
}

}  // namespace simsense::reference
