// From irradiance to counts, what an imager does: counts = clamp(round(gain * input * Gamma(shape, scale) + black_level + N(mu, sigma)), 0,
// 255). Halves round to even; NaN reads as 0. A 16-bit input keeps its units: with gain 1 everything above 255 saturates, so give gain =
// 255 / full scale. Thread rule: pure functions; the result does not depend on the number of workers.
#pragma once

#include "image_view.h"
#include "signal/noise.h"

namespace ks {
class ThreadPool;
}

namespace simsense {

struct SignalParameters {
  float gain = 1;  // counts per unit of input
  float black_level_dn = 0;
  float speckle_shape = 0;  // 0: no multiplicative noise
  float speckle_scale = 0;
  float gaussian_mu_dn = 0;
  float gaussian_sigma_dn = 0;

  [[nodiscard]] bool is_neutral() const {
    return gain == 1 && black_level_dn == 0 && !(speckle_shape > 0) && gaussian_mu_dn == 0 && gaussian_sigma_dn == 0;
  }
  [[nodiscard]] bool is_noisy() const { return speckle_shape > 0 || gaussian_sigma_dn > 0; }
};

/// input: [height][width], KS_FORMAT_U8, U16 or F32. counts: packed [height][width].
void measure(const SignalParameters& parameters, const NoiseKey& key, const ConstPlane& input, uint32_t width, uint32_t height,
             uint8_t* counts, ks::ThreadPool& workers);

}  // namespace simsense
