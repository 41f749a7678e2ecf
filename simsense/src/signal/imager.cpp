// SPDX-License-Identifier: Apache-2.0
#include "signal/imager.h"

#include <cmath>

#include "device/error.h"
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

void check_signal(const simsense_signal& s, const char* side) {
  check_fields(s, std::string(side) + " signal: ");
  if (s.speckle_shape > 0 && !(s.speckle_scale > 0))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s signal: speckle_scale is %g with speckle_shape %g: must be > 0 (1 / shape keeps the mean)",
             side, s.speckle_scale, s.speckle_shape);
  if (s.speckle_psf_sigma_px > 0 && s.speckle_psf_sigma_px < 0.1f)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s signal: speckle_psf_sigma_px is %g: must be 0 (white) or 0.1..16", side,
             s.speckle_psf_sigma_px);
  if (s.extra_bits > 0 && s.bit_depth != 8)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s signal: extra_bits is %u with a bit_depth of %u: must be 0, or bit_depth 8", side, s.extra_bits,
             s.bit_depth);
  if (s.blooming > 0 && !(s.full_well_e > 0))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s signal: blooming is %g with full_well_e %g: an unbounded well cannot overflow", side,
             s.blooming, s.full_well_e);
  const float doublings = (s.temperature_c - s.dark_reference_c) / s.dark_doubling_k;
  if (doublings > 40)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s signal: dark current doubles %g times from dark_reference_c %g to temperature_c %g: at most 40",
             side, doublings, s.dark_reference_c, s.temperature_c);
}

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
