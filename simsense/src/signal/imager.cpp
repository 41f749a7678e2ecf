// SPDX-License-Identifier: Apache-2.0
#include "signal/imager.h"

#include "parameters/fields.h"

namespace simsense {
namespace {

bool is_identity(const simsense_signal& s) {
  const bool has_dark = s.dark_current_e_per_s > 0 || (s.hot_pixel_share > 0 && s.hot_pixel_e_per_s > 0);
  const float gains = s.responsivity_e * s.exposure_s * (s.conversion_gain_dn_per_e * s.gain);
  return !has_noise(s) && !has_dark && gains == 1 && s.full_well_e == 0 && s.response_exponent == 1 && black_dn(s) == 0 && s.bit_depth == 8;
}

simsense_signal of_all_bits(simsense_signal s) {
  const auto steps = static_cast<float>(1u << s.extra_bits);
  for (float* dn : {&s.conversion_gain_dn_per_e, &s.adc_noise_dn, &s.black_level_dn, &s.black_level_dn_per_k}) *dn *= steps;
  s.bit_depth += s.extra_bits;
  return s;
}

bool has_same_speckle(const simsense_signal& a, const simsense_signal& b) {
  return a.speckle_shape == b.speckle_shape && a.speckle_scale == b.speckle_scale && a.speckle_correlation == b.speckle_correlation;
}

}  // namespace

Imager::Imager(const simsense_signal& signal, const Imager* former)
    : stated_(signal), signal_(of_all_bits(signal)), is_neutral_(is_identity(signal_)) {
  const double shape = signal.speckle_shape, fixed = signal.speckle_correlation;
  if (former && has_same_speckle(signal, former->signal_)) {
    static_speckle_ = former->static_speckle_;
    temporal_speckle_ = former->temporal_speckle_;
    return;
  }
  if (shape * fixed > 0) static_speckle_ = GammaTable(shape * fixed, signal.speckle_scale);
  if (shape * (1 - fixed) > 0) temporal_speckle_ = GammaTable(shape * (1 - fixed), signal.speckle_scale);
}

bool Imager::has_noise() const { return simsense::has_noise(signal_); }

}  // namespace simsense
