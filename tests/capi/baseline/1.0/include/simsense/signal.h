/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SIMSENSE_SIGNAL_H
#define SIMSENSE_SIGNAL_H
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#ifdef __cplusplus
extern "C" {
#endif
#define SIMSENSE_TYPE_SIGNAL 0x2005u
typedef struct simsense_signal {
  ks_header header;
  float exposure_s;
  float responsivity_e;
  float speckle_shape;
  float speckle_scale;
  float speckle_correlation;
  float speckle_psf_sigma_px;
  float prnu;
  float dark_current_e_per_s;
  float hot_pixel_share;
  float hot_pixel_e_per_s;
  float temperature_c;
  float dark_reference_c;
  float dark_doubling_k;
  float shot_noise;
  float full_well_e;
  float blooming;
  float dsnu_e;
  float row_fixed_e;
  float column_fixed_e;
  float row_noise_e;
  float column_noise_e;
  float read_noise_e;
  float conversion_gain_dn_per_e;
  float gain;
  float response_exponent;
  float adc_noise_dn;
  float black_level_dn;
  float black_level_dn_per_k;
  uint32_t bit_depth;
  uint32_t first_view;
  uint64_t scene_index;
} simsense_signal;
static inline simsense_signal simsense_signal_init(void) {
  simsense_signal s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(SIMSENSE_TYPE_SIGNAL, KS_CAST(uint32_t, sizeof s));
  s.exposure_s = 1.0f;
  s.responsivity_e = 1.0f;
  s.temperature_c = 25.0f;
  s.dark_reference_c = 25.0f;
  s.dark_doubling_k = 8.0f;
  s.conversion_gain_dn_per_e = 1.0f;
  s.gain = 1.0f;
  s.response_exponent = 1.0f;
  s.bit_depth = 8u;
  return s;
}
#ifdef __cplusplus
}
#endif
#endif
