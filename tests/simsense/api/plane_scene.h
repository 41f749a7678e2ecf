// SPDX-License-Identifier: Apache-2.0
// Images of a plane with a random dot texture, from the camera model: pixel means over supersampled rays, lenses and poses honoured.
#pragma once

#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "simsense/api/sensor.h"

namespace simsense_test {

/// Of a row-major 4x4.
inline cv::Matx33d rotation(const double* pose) { return cv::Matx44d(pose).get_minor<3, 3>(0, 0); }
inline cv::Vec3d translation(const double* pose) { return {pose[3], pose[7], pose[11]}; }

/// Direction of a pixel at z = 1, the lens, if any, undone by fixed-point iteration.
inline cv::Vec3d ray(const simsense_camera& c, double u, double v) {
  const double* d = c.lens.distortion;
  const double x0 = (u - c.k[2]) / c.k[0], y0 = (v - c.k[5]) / c.k[4];
  double x = x0, y = y0;
  const bool lens = d[0] != 0 || d[1] != 0 || d[2] != 0 || d[3] != 0 || d[4] != 0;
  for (int i = 0; lens && i < 20; ++i) {
    const double r2 = x * x + y * y, radial = 1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]));
    const double dx = 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x), dy = d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y;
    x = (x0 - dx) / radial;
    y = (y0 - dy) / radial;
  }
  return {x, y, 1};
}

/// A plane normal . p = distance in the left camera's frame, covered with Gaussian dots, one in each cell of a jittered grid.
struct Plane {
  cv::Vec3d normal{0, 0, 1};
  double distance_m = 1;
  double cell_m = 0.007;  // about 3 pixels
  uint32_t seed = 1;

  /// z of the plane along a ray of a camera whose frame is the left one's turned by left_to_camera and moved.
  [[nodiscard]] double depth(const double* left_to_camera, const cv::Vec3d& direction) const {
    const cv::Vec3d n = rotation(left_to_camera) * normal;
    return (distance_m + n.dot(translation(left_to_camera))) / n.dot(direction) * direction[2];
  }

  [[nodiscard]] double texture(double x, double y) const {
    const double gx = x / cell_m, gy = y / cell_m;
    double value = 0.1;
    for (int j = -1; j <= 1; ++j)
      for (int i = -1; i <= 1; ++i) {
        const auto cx = static_cast<int32_t>(std::floor(gx)) + i, cy = static_cast<int32_t>(std::floor(gy)) + j;
        uint32_t h = static_cast<uint32_t>(cx) * 0x9E3779B1u ^ static_cast<uint32_t>(cy) * 0x85EBCA77u ^ seed * 0xC2B2AE3Du;
        h = (h ^ (h >> 15)) * 0x2C1B3C6Du;
        h = (h ^ (h >> 12)) * 0x297A2D39u;
        h ^= h >> 15;
        const double px = cx + (h & 255) / 255.0 - gx, py = cy + ((h >> 8) & 255) / 255.0 - gy, brightness = ((h >> 16) & 255) / 255.0;
        value += brightness * std::exp(-(px * px + py * py) / (2 * 0.35 * 0.35));
      }
    return value;
  }
};

/// 8-bit image of the plane; left_to_camera: row-major 4x4.
inline std::vector<uint8_t> render(const Plane& plane, const simsense_camera& c, const double* left_to_camera) {
  constexpr int samples = 3;
  std::vector<uint8_t> image(size_t{c.width} * c.height);
  const cv::Matx33d back = rotation(left_to_camera).t();
  for (uint32_t v = 0; v < c.height; ++v)
    for (uint32_t u = 0; u < c.width; ++u) {
      double sum = 0;
      for (int s = 0; s < samples * samples; ++s) {
        const cv::Vec3d d = ray(c, u + (s % samples + 0.5) / samples - 0.5, v + (s / samples + 0.5) / samples - 0.5);
        const cv::Vec3d p = back * (d * (plane.depth(left_to_camera, d) / d[2]) - translation(left_to_camera));
        sum += plane.texture(p[0], p[1]);
      }
      image[size_t{v} * c.width + u] = static_cast<uint8_t>(std::fmin(255.0, 140 * sum / (samples * samples)));
    }
  return image;
}

inline constexpr double identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

inline Pair photograph(const Plane& plane, const simsense_rig_desc& rig) {
  return {render(plane, rig.left, identity), render(plane, rig.right, rig.left_to_right)};
}

}  // namespace simsense_test
