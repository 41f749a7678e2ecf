#include "signal/signal.h"

#include <array>
#include <cmath>

#include "device/error.h"
#include "device/thread_pool.h"
#include "ks/image.h"

namespace simsense {
namespace {

uint8_t to_counts(float value) {
  if (value >= 255) return 255;
  return value > 0 ? static_cast<uint8_t>(std::lrint(value)) : uint8_t{0};
}

template <class T>
void measure_quiet(const SignalParameters& p, const ConstPlane& input, uint32_t width, uint32_t y, uint8_t* row) {
  const float offset = p.black_level_dn + p.gaussian_mu_dn;
  for (uint32_t x = 0; x < width; ++x) row[x] = to_counts(p.gain * static_cast<float>(input.at<T>(x, y)) + offset);
}

/// 8-bit input without noise has 256 answers.
void measure_lut(const std::array<uint8_t, 256>& lut, const ConstPlane& input, uint32_t width, uint32_t y, uint8_t* row) {
  for (uint32_t x = 0; x < width; ++x) row[x] = lut[input.at<uint8_t>(x, y)];
}

template <class T>
void measure_noisy(const SignalParameters& p, const GammaSampler& gamma, const PhiloxKey& key, const ConstPlane& input, uint32_t width,
                   uint32_t y, uint8_t* row) {
  const float offset = p.black_level_dn + p.gaussian_mu_dn;
  for (uint32_t x = 0; x < width; ++x) {
    const PixelNoise noise = pixel_noise(gamma, key, x, y);
    row[x] = to_counts(p.gain * static_cast<float>(input.at<T>(x, y)) * noise.factor + offset + p.gaussian_sigma_dn * noise.normal);
  }
}

template <class T>
void measure_as(const SignalParameters& p, const NoiseKey& noise_key, const ConstPlane& input, uint32_t width, uint32_t height,
                uint8_t* counts, ks::ThreadPool& workers) {
  const GammaSampler gamma(p.speckle_shape, p.speckle_scale);
  const PhiloxKey key = image_key(noise_key);
  workers.parallel_for(height, [&](size_t row) {
    const auto y = static_cast<uint32_t>(row);
    uint8_t* out = counts + row * width;
    if (p.is_noisy())
      measure_noisy<T>(p, gamma, key, input, width, y, out);
    else
      measure_quiet<T>(p, input, width, y, out);
  });
}

}  // namespace

void measure(const SignalParameters& p, const NoiseKey& key, const ConstPlane& input, uint32_t width, uint32_t height, uint8_t* counts,
             ks::ThreadPool& workers) {
  if (input.format == KS_FORMAT_U8 && !p.is_noisy()) {
    std::array<uint8_t, 256> lut;
    for (uint32_t i = 0; i < 256; ++i) lut[i] = to_counts(p.gain * static_cast<float>(i) + p.black_level_dn + p.gaussian_mu_dn);
    workers.parallel_for(height, [&](size_t row) { measure_lut(lut, input, width, static_cast<uint32_t>(row), counts + row * width); });
    return;
  }
  switch (input.format) {
    case KS_FORMAT_U8:
      return measure_as<uint8_t>(p, key, input, width, height, counts, workers);
    case KS_FORMAT_U16:
      return measure_as<uint16_t>(p, key, input, width, height, counts, workers);
    case KS_FORMAT_F32:
      return measure_as<float>(p, key, input, width, height, counts, workers);
    default:
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "input format %u: the imager reads u8 (1), u16 (2) or f32 (6)", input.format);
  }
}

}  // namespace simsense
