// SPDX-License-Identifier: Apache-2.0
// Smooth glass whose channels differ: under a film, or by dispersion (KHR_materials_dispersion), which bends each of them by an index of its own.
// Light that is refracted then goes on in one channel, drawn by what the path carries; the others end. What is left of a path tells its channel.
#ifndef KUAFU_DISPERSION_GLSL
#define KUAFU_DISPERSION_GLSL
#include "lib/glass.glsl"

bool parts_colors(float dispersion, bool thin) { return channels > 1u && (features & feature_dispersion) != 0u && dispersion > 0.0f && !thin; }

/// Cauchy's law: (n - 1) / (n at 587.6 nm - 1) - 1 at 611.4, 549.1 and 464.3 nm, for a dispersion of 1, which is Abbe's number 20.
float cauchy_part(uint c) { return c == 0u ? -0.0057989f : c == 1u ? 0.0109970f : 0.0456147f; }

/// n_viewer / n_other of a channel.
float channel_eta(float eta, float dispersion, uint c) {
  if (!parts_colors(dispersion, false)) return eta;
  float ior = max(eta, 1.0f / eta), shifted = max(1.0f + (ior - 1.0f) * (1.0f + dispersion * cauchy_part(c)), 1.0f);
  return eta > 1.0f ? shifted : 1.0f / shifted;
}

float mean_by(Spectrum weights, Spectrum values) {
  float sum = 0.0f, all = 0.0f;
  for (uint c = 0u; c < channels; ++c) {
    sum += channel_of(weights, c) * channel_of(values, c);
    all += channel_of(weights, c);
  }
  return all > 0.0f ? min(sum / all, 1.0f) : 1.0f;
}

struct Refraction {
  vec3 direction;
  Spectrum weight;
};

/// u in [0, 1) draws the channel.
Refraction refract_channel(IN(Glass) g, vec3 wo, Spectrum reflected, float u) {
  Spectrum through = g.tint * (Spectrum(1.0f) - reflected), wanted = through * g.carries;
  Refraction r = Refraction(vec3(-xy(wo), -wo.z), Spectrum(0.0f));
  float sum = 0.0f, rest;
  for (uint c = 0u; c < channels; ++c) sum += channel_of(wanted, c);
  if (sum <= 0.0f) return r;
  rest = u * sum;
  uint taken = 0u;
  for (uint c = 0u; c < channels; ++c) {
    if (channel_of(wanted, c) <= 0.0f) continue;
    taken = c;
    rest -= channel_of(wanted, c);
    if (rest < 0.0f) break;
  }
  float cos_t, eta = channel_eta(g.eta, g.dispersion, taken);
  fresnel_dielectric(wo.z, eta, cos_t);
  r.direction = vec3(-eta * xy(wo), -cos_t);
  set_channel(r.weight, taken, channel_of(through, taken) * eta * eta * sum / channel_of(wanted, taken));
  return r;
}

/// Of each channel, and by its index.
Spectrum reflected_channels(IN(Glass) g, float cosine) {
  float cos_t;
  Glass one = g;
  Spectrum each = Spectrum(0.0f);
  for (uint c = 0u; c < channels; ++c) {
    one.eta = channel_eta(g.eta, g.dispersion, c);
    Spectrum r = filmed_reflectance(one, cosine, cos_t);
    set_channel(each, c, channel_of(r, c));
  }
  return each;
}
#endif
