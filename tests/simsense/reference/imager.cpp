// SPDX-License-Identifier: Apache-2.0
#include "simsense/reference/imager.h"

#include <algorithm>
#include <cmath>

#include "signal/gamma_quantile.h"
#include "signal/imager.h"

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

namespace {

class Image {
 public:
  Image(const simsense_signal& signal, const NoiseKey& key, std::vector<double> values, std::vector<double> laser, uint32_t width,
        uint32_t height)
      : s(signal), keys(key), values_(std::move(values)), laser_(std::move(laser)), width_(width), height_(height) {}

  void expose();
  void speckle();
  void respond_unevenly();
  void add_dark_charge();
  void add_shot_noise();
  void fill_wells();
  void add_readout_noise();
  void amplify_and_respond();
  std::vector<uint16_t> convert();

 private:
  template <class F>
  void each(F&& f) {
    for (uint32_t y = 0; y < height_; ++y)
      for (uint32_t x = 0; x < width_; ++x) f(values_[size_t{y} * width_ + x], x, y);
  }
  static double normal(const PhiloxKey& key, Dimension dimension, uint32_t x, uint32_t y) {
    return normal_quantile(pixel_word(key, dimension, x, y));
  }
  [[nodiscard]] double grain_normal(const PhiloxKey& key, Dimension dimension, uint32_t x, uint32_t y) const;
  [[nodiscard]] double dark_seconds() const {
    return s.exposure_s * std::pow(2.0, (s.temperature_c - s.dark_reference_c) / double{s.dark_doubling_k});
  }
  void flow(uint32_t x, bool down, const std::vector<double>& overflow);

  const simsense_signal& s;
  StreamKeys keys;
  std::vector<double> values_, laser_;  // no laser: all light has speckle
  uint32_t width_, height_;
};

void Image::expose() {
  for (std::vector<double>* light : {&values_, &laser_})
    for (double& v : *light) v = std::isnan(v) ? 0 : v * s.responsivity_e * s.exposure_s;
}

double Image::grain_normal(const PhiloxKey& key, Dimension dimension, uint32_t x, uint32_t y) const {
  if (s.speckle_psf_sigma_px == 0) return normal(key, dimension, x, y);
  const std::vector<float> weights = grain_kernel(s.speckle_psf_sigma_px);
  const auto size = static_cast<uint32_t>(weights.size()), radius = size / 2;
  double sum = 0;
  for (uint32_t j = 0; j < size; ++j)
    for (uint32_t i = 0; i < size; ++i) sum += double{weights[i]} * weights[j] * normal(key, dimension, x + i - radius, y + j - radius);
  return sum;
}

void Image::speckle() {
  const double fixed = s.speckle_shape * s.speckle_correlation, temporal = s.speckle_shape - fixed;
  if (s.speckle_shape == 0) return;
  each([&](double& v, uint32_t x, uint32_t y) {
    double factor = 0;
    if (fixed > 0) factor += gamma_quantile(fixed, grain_normal(keys.scene, Dimension::speckle_static, x, y));
    if (temporal > 0) factor += gamma_quantile(temporal, grain_normal(keys.frame, Dimension::speckle_temporal, x, y));
    const double coherent = laser_.empty() ? v : std::max(0.0, std::min(laser_[size_t{y} * width_ + x], v));
    v += coherent * (factor * s.speckle_scale - 1);
  });
}

void Image::respond_unevenly() {
  if (s.prnu > 0)
    each([&](double& v, uint32_t x, uint32_t y) { v *= std::max(0.0, 1 + s.prnu * normal(keys.sensor, Dimension::prnu, x, y)); });
}

void Image::add_dark_charge() {
  each([&](double& v, uint32_t x, uint32_t y) {
    v += s.dark_current_e_per_s * dark_seconds();
    const double uniform = (pixel_word(keys.sensor, Dimension::hot_pixel, x, y) + 0.5) / 4294967296.0;
    if (uniform < s.hot_pixel_share) v += s.hot_pixel_e_per_s * dark_seconds() * -std::log(uniform / s.hot_pixel_share);
  });
}

void Image::add_shot_noise() {
  if (s.shot_noise == 0) return;
  each([&](double& v, uint32_t x, uint32_t y) {
    v += s.shot_noise * (poisson_quantile(v, pixel_word(keys.frame, Dimension::shot, x, y)) - v);
  });
}

/// One column's overflow, one way: what each pixel gives travels until it finds room.
void Image::flow(uint32_t x, bool down, const std::vector<double>& overflow) {
  double travelling = 0;
  for (uint32_t n = 0; n < height_; ++n) {
    const uint32_t y = down ? n : height_ - 1 - n;
    double& v = values_[size_t{y} * width_ + x];
    const double taken = std::min(travelling, s.full_well_e - v);
    v += taken;
    travelling += 0.5 * s.blooming * overflow[y] - taken;
  }
}

void Image::fill_wells() {
  if (s.full_well_e == 0) return;
  for (uint32_t x = 0; x < width_; ++x) {
    std::vector<double> overflow;
    for (uint32_t y = 0; y < height_; ++y) {
      double& v = values_[size_t{y} * width_ + x];
      overflow.push_back(std::max(0.0, v - s.full_well_e));
      v -= overflow.back();
    }
    flow(x, true, overflow);
    flow(x, false, overflow);
  }
}

void Image::add_readout_noise() {
  const auto add = [&](double sigma, const PhiloxKey& key, Dimension dimension, bool by_column, bool by_row) {
    if (sigma > 0) each([&](double& v, uint32_t x, uint32_t y) { v += sigma * normal(key, dimension, by_column ? x : 0, by_row ? y : 0); });
  };
  add(s.dsnu_e, keys.sensor, Dimension::dsnu, true, true);
  add(s.row_fixed_e, keys.sensor, Dimension::row_fixed, false, true);
  add(s.column_fixed_e, keys.sensor, Dimension::column_fixed, true, false);
  add(s.row_noise_e, keys.frame, Dimension::row_temporal, false, true);
  add(s.column_noise_e, keys.frame, Dimension::column_temporal, true, false);
  add(s.read_noise_e, keys.frame, Dimension::read, true, true);
}

void Image::amplify_and_respond() {
  const double full_scale = std::pow(2.0, s.bit_depth) - 1;
  each([&](double& v, uint32_t, uint32_t) {
    v *= double{s.conversion_gain_dn_per_e} * s.gain;
    if (s.response_exponent != 1) v = std::copysign(full_scale * std::pow(std::abs(v) / full_scale, double{s.response_exponent}), v);
  });
}

std::vector<uint16_t> Image::convert() {
  const double full_scale = std::pow(2.0, s.bit_depth) - 1;
  const double black = s.black_level_dn + s.black_level_dn_per_k * (s.temperature_c - s.dark_reference_c);
  std::vector<uint16_t> counts;
  each([&](double& v, uint32_t x, uint32_t y) {
    if (s.adc_noise_dn > 0) v += s.adc_noise_dn * normal(keys.frame, Dimension::adc, x, y);
    counts.push_back(static_cast<uint16_t>(std::clamp(std::nearbyint(v + black), 0.0, full_scale)));
  });
  return counts;
}

}  // namespace

std::vector<uint16_t> measure(const simsense_signal& signal, const NoiseKey& key, const std::vector<double>& input, uint32_t width,
                              uint32_t height, const std::vector<double>& laser) {
  Image image(signal, key, input, laser, width, height);
  image.expose();
  image.speckle();
  image.respond_unevenly();
  image.add_dark_charge();
  image.add_shot_noise();
  image.fill_wells();
  image.add_readout_noise();
  image.amplify_and_respond();
  return image.convert();
}

}  // namespace simsense::reference
