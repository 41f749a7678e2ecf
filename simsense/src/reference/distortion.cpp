// SPDX-License-Identifier: Apache-2.0
#include "reference/distortion.h"

namespace simsense::reference {

std::array<double, 2> distort(const simsense_camera& camera, double x, double y) {
  const double k1 = camera.distortion[0], k2 = camera.distortion[1], p1 = camera.distortion[2], p2 = camera.distortion[3],
               k3 = camera.distortion[4];
  const double r2 = x * x + y * y;
  const double radial = 1 + k1 * r2 + k2 * r2 * r2 + k3 * r2 * r2 * r2;
  return {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
}

}  // namespace simsense::reference
