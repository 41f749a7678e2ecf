// SPDX-License-Identifier: Apache-2.0
// From charge to counts: full well, fixed and temporal noise of pixels, rows and columns, amplifier, response curve, converter.
#ifndef SIMSENSE_SIGNAL_READOUT_GLSL
#define SIMSENSE_SIGNAL_READOUT_GLSL
#include "lib/signal/math.glsl"
#include "lib/signal/random.glsl"
#include "shared/signal_push.h"

vec4 readout_noise(SignalParameters p, SignalKeys keys, uint quad, uint y) {
  vec4 noise = vec4(0.0f);
  if (p.dsnu_e != 0.0f) noise += normals_of(quad_words(keys.sensor, DIMENSION_DSNU, quad, y)) * p.dsnu_e;
  if (p.row_fixed_e != 0.0f) noise += normals_of(quad_words(keys.sensor, DIMENSION_ROW_FIXED, 0u, y)).x * p.row_fixed_e;
  if (p.column_fixed_e != 0.0f) noise += normals_of(quad_words(keys.sensor, DIMENSION_COLUMN_FIXED, quad, 0u)) * p.column_fixed_e;
  if (p.row_noise_e != 0.0f) noise += normals_of(quad_words(keys.frame, DIMENSION_ROW_TEMPORAL, 0u, y)).x * p.row_noise_e;
  if (p.column_noise_e != 0.0f) noise += normals_of(quad_words(keys.frame, DIMENSION_COLUMN_TEMPORAL, quad, 0u)) * p.column_noise_e;
  if (p.read_noise_e != 0.0f) noise += normals_of(quad_words(keys.frame, DIMENSION_READ, quad, y)) * p.read_noise_e;
  return noise;
}

/// The power law, odd about 0 so that noise in the dark keeps its mean; full scale stays. What exceeds it fourfold is cut.
vec4 respond(vec4 dn, float exponent, float max_dn) {
  const float smallest = 1e-30f;
  vec4 relative = min(abs(dn) / max_dn, 4.0f);
  vec4 power = exponential(exponent * natural_log(max(relative, smallest)));
  return mix(vec4(0.0f), sign(dn) * power * max_dn, greaterThan(relative, vec4(smallest)));
}

uvec4 read_out(SignalParameters p, SignalKeys keys, vec4 charge, uint quad, uint y) {
  if (p.full_well_e > 0.0f) charge = min(charge, p.full_well_e);
  precise vec4 dn = (charge + readout_noise(p, keys, quad, y)) * p.dn_per_e;
  if (p.response_exponent != 1.0f) dn = respond(dn, p.response_exponent, p.max_dn);
  if (p.adc_noise_dn != 0.0f) dn += normals_of(quad_words(keys.frame, DIMENSION_ADC, quad, y)) * p.adc_noise_dn;
  return uvec4(roundEven(clamp(dn + p.black_dn, 0.0f, p.max_dn)));
}
#endif
