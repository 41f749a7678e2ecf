// SPDX-License-Identifier: Apache-2.0
#include "simsense/reference/rectify.h"

#include <cmath>

#include "simsense/reference/depth.h"

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

}  // namespace simsense::reference
