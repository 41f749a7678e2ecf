#include "reference/signal.h"

#include <algorithm>
#include <cmath>

namespace simsense::reference {
namespace {

double uniform(uint32_t bits) { return (bits + 0.5) / 4294967296.0; }

/// Marsaglia and Tsang 2000, section 2, with the boost of section 6 for shapes below 1; the plain acceptance test.
double gamma_draw(double shape, double scale, PhiloxKey key, uint32_t x, uint32_t y) {
  const double d = (shape < 1 ? shape + 1 : shape) - 1.0 / 3.0;
  for (uint32_t attempt = 0;; ++attempt) {
    const PhiloxBlock bits = philox({x, y, attempt, 0}, key);
    const double z = std::sqrt(-2 * std::log(uniform(bits[0]))) * std::cos(2 * M_PI * uniform(bits[1]));
    const double v = std::pow(1 + z / std::sqrt(9 * d), 3);
    if (v <= 0 || std::log(uniform(bits[2])) >= z * z / 2 + d - d * v + d * std::log(v)) continue;
    return d * v * scale * (shape < 1 ? std::pow(uniform(bits[3]), 1 / shape) : 1.0);
  }
}

double normal_draw(PhiloxKey key, uint32_t x, uint32_t y) {
  const PhiloxBlock bits = philox({x, y, 0, 0}, key);
  return std::sqrt(-2 * std::log(uniform(bits[0]))) * std::sin(2 * M_PI * uniform(bits[1]));
}

}  // namespace

std::vector<uint8_t> measure(const SignalParameters& p, const NoiseKey& noise_key, const std::vector<double>& input, uint32_t width,
                             uint32_t height) {
  const PhiloxKey key = image_key(noise_key);
  std::vector<uint8_t> counts(size_t{width} * height);
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x) {
      double value = p.gain * input[size_t{y} * width + x];
      if (p.speckle_shape > 0) value *= gamma_draw(p.speckle_shape, p.speckle_scale, key, x, y);
      value += p.black_level_dn + p.gaussian_mu_dn;
      if (p.gaussian_sigma_dn > 0) value += p.gaussian_sigma_dn * normal_draw(key, x, y);
      counts[size_t{y} * width + x] = static_cast<uint8_t>(std::clamp(std::nearbyint(value), 0.0, 255.0));
    }
  return counts;
}

}  // namespace simsense::reference
