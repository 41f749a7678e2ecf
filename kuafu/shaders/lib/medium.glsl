// SPDX-License-Identifier: Apache-2.0
// A homogeneous participating medium: Beer and Lambert's law, where a ray is scattered, and Henyey and Greenstein's phase function (1941).
#ifndef KUAFU_MEDIUM_GLSL
#define KUAFU_MEDIUM_GLSL
#include "lib/frame.glsl"
#include "lib/language.glsl"
#include "lib/microfacet.glsl"
#include "lib/spectrum.glsl"
#include "shared/scene_records.h"

Spectrum medium_extinction(IN(MediumRecord) m) { return band_of(m.extinction); }
Spectrum medium_albedo(IN(MediumRecord) m) { return band_of(m.albedo); }

/// 1 - e^-x, without cancellation.
float one_minus_exp(float x) { return x < 1e-3f ? x * (1.0f - 0.5f * x) : 1.0f - exp(-x); }
/// -log(1 - x), without cancellation.
float minus_log_of_rest(float x) { return x < 1e-3f ? x * (1.0f + 0.5f * x) : -log(1.0f - x); }

/// Where a ray's part from t_near to t_far metres enters and leaves the medium's box.
vec2 medium_part(IN(MediumRecord) m, vec3 origin, vec3 direction, float t_near, float t_far) {
  float begin = t_near, end = t_far;
  for (uint axis = 0u; axis < 3u; ++axis) {
    float inverse = 1.0f / (abs(direction[axis]) < 1e-30f ? 1e-30f : direction[axis]);
    float a = (m.bounds_min[axis] - origin[axis]) * inverse, b = (m.bounds_max[axis] - origin[axis]) * inverse;
    begin = max(begin, min(a, b));
    end = min(end, max(a, b));
  }
  return vec2(begin, max(begin, end));
}

Spectrum medium_transmittance(IN(MediumRecord) m, vec3 origin, vec3 direction, float t_near, float t_far) {
  vec2 part = medium_part(m, origin, direction, t_near, t_far);
  return band_exp(medium_extinction(m) * (part.x - part.y));
}

struct Flight {
  float t;          // metres into the medium
  Spectrum weight;  // scattered light per density of t
};

/// A point of the first `length_m` metres, by the density of what is scattered there. Channels are one sampler each, weighted by the balance heuristic.
Flight sample_flight(IN(MediumRecord) m, float length_m, vec2 u) {
  Spectrum extinction = medium_extinction(m), albedo = medium_albedo(m);
  float shares[3], sum = 0.0f;
  for (uint c = 0u; c < channels; ++c) {
    shares[c] = channel_of(albedo, c) * one_minus_exp(min(channel_of(extinction, c) * length_m, 1e3f));
    sum += shares[c];
  }
  Flight flight = Flight(0.0f, Spectrum(0.0f));
  if (sum == 0.0f) return flight;
  uint chosen = 0u;
  float rest = u.y * sum - shares[0];
  while (rest >= 0.0f && chosen + 1u < channels) rest -= shares[++chosen];
  float sigma = channel_of(extinction, chosen);
  flight.t = min(minus_log_of_rest(u.x * one_minus_exp(min(sigma * length_m, 1e3f))) / sigma, length_m);
  float density = 0.0f;  // of t, times sum
  for (uint c = 0u; c < channels; ++c) density += channel_of(albedo, c) * channel_of(extinction, c) * exp(-channel_of(extinction, c) * flight.t);
  flight.weight = albedo * extinction * band_exp(extinction * -flight.t) * (sum / max(density, 1e-30f));
  return flight;
}

/// Per solid angle; cosine between the ways of the light before and after.
float phase(float g, float cosine) {
  float d = max(1.0f + g * g - 2.0f * g * cosine, 1e-12f);
  return (1.0f - g * g) / (4.0f * pi * d * sqrt(d));
}

/// A direction around z by the phase function.
vec3 sample_phase(float g, vec2 u) {
  float cosine = 1.0f - 2.0f * u.x;
  if (abs(g) > 1e-3f) {
    float s = (1.0f - g * g) / (1.0f - g + 2.0f * g * u.x);
    cosine = clamp((1.0f + g * g - s * s) / (2.0f * g), -1.0f, 1.0f);
  }
  float sine = sqrt(max(1.0f - cosine * cosine, 0.0f)), phi = 2.0f * pi * u.y;
  return vec3(sine * cos(phi), sine * sin(phi), cosine);
}
#endif
