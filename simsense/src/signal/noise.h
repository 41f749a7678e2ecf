// The random part of the imager at one pixel: a Gamma factor (Marsaglia, Tsang: A simple method for generating gamma variables. ACM TOMS
// 26(3), 2000) and a standard normal (Box and Muller 1958), both from Philox blocks whose counter is (x, y, attempt).
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include "signal/philox.h"

namespace simsense {

/// What one image's noise depends on. Equal keys give equal noise; any difference gives an independent stream.
struct NoiseKey {
  uint64_t seed = 0, frame_index = 0;
  uint32_t batch_index = 0, eye = 0;  // eye: 0 left, 1 right
};

/// The image's Philox key: the 64-bit seed encrypts (frame, batch, eye), so that 161 bits of address fit a 64-bit key.
inline PhiloxKey image_key(const NoiseKey& k) {
  const PhiloxBlock block = philox({static_cast<uint32_t>(k.frame_index), static_cast<uint32_t>(k.frame_index >> 32), k.batch_index, k.eye},
                                   {static_cast<uint32_t>(k.seed), static_cast<uint32_t>(k.seed >> 32)});
  return {block[0], block[1]};
}

/// Constants of the Gamma(shape, scale) sampler. shape 0 means no factor: every draw is 1.
struct GammaSampler {
  float d = 0, c = 0, scale = 1, boost_exponent = 0;  // boost: Gamma(a) = Gamma(a + 1) U^(1/a) for a < 1
  bool enabled = false;

  GammaSampler(float shape, float scale_in) {
    if (!(shape > 0)) return;
    enabled = true;
    scale = scale_in;
    boost_exponent = shape < 1 ? 1 / shape : 0;
    d = (shape < 1 ? shape + 1 : shape) - 1.0f / 3.0f;
    c = 1 / std::sqrt(9 * d);
  }
};

struct PixelNoise {
  float factor;  // Gamma(shape, scale), or 1
  float normal;  // N(0, 1), independent of factor
};

/// The acceptance test in double: for large shapes d - d v + d ln v cancels. The squeeze spares it nearly always.
inline bool gamma_accepts(float uniform, float x, float v, float d) {
  const float x2 = x * x;
  if (uniform < 1 - 0.0331f * x2 * x2) return true;
  const double shape = d;
  return std::log(static_cast<double>(uniform)) < 0.5 * x2 + shape * (1.0 - v + std::log(static_cast<double>(v)));
}

inline PixelNoise pixel_noise(const GammaSampler& gamma, const PhiloxKey& key, uint32_t x, uint32_t y) {
  PixelNoise noise{1, 0};
  for (uint32_t attempt = 0;; ++attempt) {
    const PhiloxBlock bits = philox({x, y, attempt, 0}, key);
    const float radius = std::sqrt(-2 * std::log(philox_uniform(bits[0])));
    const float angle = 2 * std::numbers::pi_v<float> * philox_uniform(bits[1]);
    if (attempt == 0) noise.normal = radius * std::sin(angle);
    if (!gamma.enabled) return noise;
    const float normal = radius * std::cos(angle);
    const float root = 1 + gamma.c * normal;
    const float v = root * root * root;
    if (root <= 0 || !gamma_accepts(philox_uniform(bits[2]), normal, v, gamma.d)) continue;
    noise.factor = gamma.d * v * gamma.scale;
    if (gamma.boost_exponent > 0) noise.factor *= std::pow(philox_uniform(bits[3]), gamma.boost_exponent);
    return noise;
  }
}

}  // namespace simsense
