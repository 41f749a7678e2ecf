// SPDX-License-Identifier: Apache-2.0
#include "optics/gaussian.h"

#include <cmath>

namespace kuafu {

uint32_t gaussian_radius(double variance) { return variance > 0.0 ? uint32_t(std::ceil(5.0 * std::sqrt(variance))) + 2 : 0; }

// Miller's recurrence goes downwards from where I_n is negligible: I_{n-1} = I_{n+1} + 2 n / t I_n. Dividing by the sum removes its scale.
std::vector<float> gaussian_kernel(double variance, uint32_t radius) {
  std::vector<double> taps(radius + 1, 0.0);
  taps[0] = 1.0;
  double sum = 1.0;
  if (variance > 1e-9) {
    double above = 0.0, here = 1e-200;
    sum = 0.0;
    for (uint32_t n = 2 * radius + 40; n > 0; --n) {
      const double below = above + 2.0 * n / variance * here;
      if (n <= radius) sum += 2.0 * (taps[n] = here);
      above = here;
      here = below;
      if (here < 1e200) continue;
      for (double& tap : taps) tap *= 1e-300;
      above *= 1e-300;
      here *= 1e-300;
      sum *= 1e-300;
    }
    sum += taps[0] = here;
  }
  std::vector<float> kernel;
  kernel.reserve(taps.size());
  for (const double tap : taps) kernel.push_back(float(tap / sum));
  return kernel;
}

}  // namespace kuafu
