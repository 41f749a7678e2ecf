// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "simsense/reference/imager.h"

namespace simsense::reference {
namespace {

double upper_tail(double z) { return 0.5 * std::erfc(z / std::sqrt(2.0)); }

}  // namespace

/// Bisection on the smaller tail.
double normal_quantile(uint32_t word) {
  const double uniform = (word + 0.5) / 4294967296.0;
  const bool low = uniform < 0.5;
  const double tail = low ? uniform : 1 - uniform;
  double near = 0, far = 7;
  for (int n = 0; n < 60; ++n) {
    const double middle = 0.5 * (near + far);
    (upper_tail(middle) > tail ? near : far) = middle;
  }
  return low ? -near : near;
}

/// Sum of the probabilities, each from its logarithm, starting where they begin to count.
double poisson_quantile(double mean, uint32_t word) {
  if (!(mean > 0)) return mean;
  const double uniform = (word + 0.5) / 4294967296.0;
  double n = std::floor(std::fmax(0, mean - 8 * std::sqrt(mean) - 10)), sum = 0;
  for (;; ++n) {
    sum += std::exp(n * std::log(mean) - mean - std::lgamma(n + 1));
    if (sum >= uniform || n > mean + 10 * std::sqrt(mean) + 40) return n;
  }
}

}  // namespace simsense::reference
