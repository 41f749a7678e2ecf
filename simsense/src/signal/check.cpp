#include <cmath>

#include "device/error.h"
#include "signal/imager.h"

namespace simsense {
namespace {

struct Range {
  const char* name;
  float simsense_signal::*field;
  float low, high;
};

constexpr float any = 1e12f;  // a bound for what has none: keeps products finite

constexpr Range ranges[] = {{"exposure_s", &simsense_signal::exposure_s, 0, any},
                            {"responsivity_e", &simsense_signal::responsivity_e, 0, any},
                            {"speckle_shape", &simsense_signal::speckle_shape, 0, any},
                            {"speckle_scale", &simsense_signal::speckle_scale, 0, any},
                            {"speckle_correlation", &simsense_signal::speckle_correlation, 0, 1},
                            {"speckle_psf_sigma_px", &simsense_signal::speckle_psf_sigma_px, 0, 16},
                            {"prnu", &simsense_signal::prnu, 0, any},
                            {"dark_current_e_per_s", &simsense_signal::dark_current_e_per_s, 0, any},
                            {"hot_pixel_share", &simsense_signal::hot_pixel_share, 0, 0.5f},
                            {"hot_pixel_e_per_s", &simsense_signal::hot_pixel_e_per_s, 0, any},
                            {"temperature_c", &simsense_signal::temperature_c, -273.15f, 1000},
                            {"dark_reference_c", &simsense_signal::dark_reference_c, -273.15f, 1000},
                            {"dark_doubling_k", &simsense_signal::dark_doubling_k, 0.1f, any},
                            {"shot_noise", &simsense_signal::shot_noise, 0, 1},
                            {"full_well_e", &simsense_signal::full_well_e, 0, any},
                            {"blooming", &simsense_signal::blooming, 0, 1},
                            {"dsnu_e", &simsense_signal::dsnu_e, 0, any},
                            {"row_fixed_e", &simsense_signal::row_fixed_e, 0, any},
                            {"column_fixed_e", &simsense_signal::column_fixed_e, 0, any},
                            {"row_noise_e", &simsense_signal::row_noise_e, 0, any},
                            {"column_noise_e", &simsense_signal::column_noise_e, 0, any},
                            {"read_noise_e", &simsense_signal::read_noise_e, 0, any},
                            {"conversion_gain_dn_per_e", &simsense_signal::conversion_gain_dn_per_e, 0, any},
                            {"gain", &simsense_signal::gain, 0, any},
                            {"response_exponent", &simsense_signal::response_exponent, 0.05f, 20},
                            {"adc_noise_dn", &simsense_signal::adc_noise_dn, 0, any},
                            {"black_level_dn", &simsense_signal::black_level_dn, -65535, 65535},
                            {"black_level_dn_per_k", &simsense_signal::black_level_dn_per_k, -65535, 65535}};

}  // namespace

void check_signal(const simsense_signal& s, const char* eye) {
  for (const Range& range : ranges) {
    const float value = s.*range.field;
    if (!(value >= range.low && value <= range.high))
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s signal: %s is %g: must be %g..%g", eye, range.name, value, range.low, range.high);
  }
  if (s.speckle_shape > 0 && !(s.speckle_scale > 0))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s signal: speckle_scale is %g with speckle_shape %g: must be > 0 (1 / shape keeps the mean)", eye,
             s.speckle_scale, s.speckle_shape);
  if (s.speckle_psf_sigma_px > 0 && s.speckle_psf_sigma_px < 0.1f)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s signal: speckle_psf_sigma_px is %g: must be 0 (white) or 0.1..16", eye, s.speckle_psf_sigma_px);
  if (s.blooming > 0 && !(s.full_well_e > 0))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s signal: blooming is %g with full_well_e %g: an unbounded well cannot overflow", eye, s.blooming,
             s.full_well_e);
  if (s.bit_depth < 8 || s.bit_depth > 16)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s signal: bit_depth is %u: must be 8..16", eye, s.bit_depth);
  const float doublings = (s.temperature_c - s.dark_reference_c) / s.dark_doubling_k;
  if (doublings > 40)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s signal: dark current doubles %g times from dark_reference_c %g to temperature_c %g: at most 40",
             eye, doublings, s.dark_reference_c, s.temperature_c);
}

}  // namespace simsense
