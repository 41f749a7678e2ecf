// SPDX-License-Identifier: Apache-2.0
// From light to collected charge: exposure, speckle, photo-response non-uniformity, dark charge, hot pixels, shot noise.
#ifndef SIMSENSE_SIGNAL_COLLECT_GLSL
#define SIMSENSE_SIGNAL_COLLECT_GLSL
#include "lib/signal/random.glsl"
#include "lib/signal/shot.glsl"
#include "shared/signal_push.h"

const float largest_charge_e = 1e30f;

/// Values that are not numbers read as 0, and no product overflows.
vec4 expose(vec4 light, float electrons_per_unit) {
  bvec4 not_number = greaterThan(floatBitsToUint(light) & 0x7fffffffu, uvec4(0x7f800000u));
  light = clamp(mix(light, vec4(0.0f), not_number), -3e38f, 3e38f);
  return clamp(light * electrons_per_unit, -largest_charge_e, largest_charge_e);
}

/// Gamma quantiles at standard normals from the table of one part of the shape.
vec4 gamma_of(SignalBlockAddress block, uint part, vec4 normal) {
  const float per_unit = 1024.0f / 13.0f;
  vec4 place = clamp((normal + 6.5f) * per_unit, 0.0f, 1024.0f), whole = floor(place), root;
  [[unroll]] for (uint i = 0u; i < 4u; ++i) {
    GammaInterval interval = block.tables.gamma[part * gamma_intervals + uint(whole[i])];
    root[i] = interval.start + interval.slope * (place[i] - whole[i]);
  }
  return root * root * root;
}

vec4 speckle_part(SignalBlockAddress block, uint n, uint quad, uint y, uint part) {
  uvec2 key = part == 0u ? block.head.keys[n].scene : block.head.keys[n].frame;
  vec4 normal;
  if (block.head.parameters.grain_radius == 0u) {
    normal = normals_of(quad_words(key, DIMENSION_SPECKLE_STATIC + part, quad, y));
  } else {
    uint pitch = block.head.parameters.pitch, at = (n * block.head.parameters.height + y) * pitch + 4u * quad;
    SignalFloats normals = block.head.parameters.normals[part];
    normal = vec4(normals.at[at], normals.at[at + 1u], normals.at[at + 2u], normals.at[at + 3u]);
  }
  return gamma_of(block, part, normal);
}

/// Gamma variates of one scale add up to one of the summed shape: the part that frames share is static, the other newly drawn.
vec4 speckle(SignalBlockAddress block, uint n, uint quad, uint y) {
  uint parts = block.head.parameters.speckle_parts;
  if (parts == 0u) return vec4(1.0f);
  vec4 factor = vec4(0.0f);
  if ((parts & 1u) != 0u) factor += speckle_part(block, n, quad, y, 0u);
  if ((parts & 2u) != 0u) factor += speckle_part(block, n, quad, y, 1u);
  return factor;
}

/// The pixels whose uniform number is below the share are hot; -ln(number / share) is the exponential strength.
vec4 hot_charge(uvec4 words, float share, float mean_e) {
  Uniform u = uniform_of(words);
  vec4 strength = -natural_log(u.tail / share) * mean_e;
  bvec4 in_share = lessThan(u.tail, vec4(share));
  return vec4(u.low.x && in_share.x, u.low.y && in_share.y, u.low.z && in_share.z, u.low.w && in_share.w) * strength;
}

/// laser: the part of the light that has speckle, where p.laser is present.
vec4 collect(SignalBlockAddress block, vec4 light, vec4 laser, uint n, uint quad, uint y) {
  SignalParameters p = block.head.parameters;
  SignalKeys keys = block.head.keys[n];
  vec4 charge = expose(light, p.electrons_per_unit), factor = speckle(block, n, quad, y);
  if (p.laser.format != 0u) {
    vec4 speckled = max(min(expose(laser, p.electrons_per_unit), charge), 0.0f);
    charge = (charge - speckled) + speckled * factor;
  } else {
    charge *= factor;
  }
  if (p.prnu != 0.0f) charge *= max(1.0f + normals_of(quad_words(keys.sensor, DIMENSION_PRNU, quad, y)) * p.prnu, 0.0f);
  charge += p.dark_e;
  if (p.hot_share != 0.0f && p.hot_mean_e != 0.0f)
    charge += hot_charge(quad_words(keys.sensor, DIMENSION_HOT_PIXEL, quad, y), p.hot_share, p.hot_mean_e);
  if (p.shot_noise != 0.0f)
    charge = poisson_of(charge, quad_words(keys.frame, DIMENSION_SHOT, quad, y)) * p.shot_noise + charge * (1.0f - p.shot_noise);
  return charge;
}
#endif
