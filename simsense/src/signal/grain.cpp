// SPDX-License-Identifier: Apache-2.0
#include "signal/imager.h"

#include <cmath>

namespace simsense {

std::vector<float> grain_kernel(float sigma_px) {
  const int radius = static_cast<int>(std::ceil(4 * sigma_px));
  std::vector<float> weights;
  double squares = 0;
  for (int k = -radius; k <= radius; ++k) {
    const double weight = std::exp(-0.5 * k * k / (static_cast<double>(sigma_px) * sigma_px));
    weights.push_back(static_cast<float>(weight));
    squares += weight * weight;
  }
  for (float& weight : weights) weight /= static_cast<float>(std::sqrt(squares));
  return weights;
}

}  // namespace simsense
