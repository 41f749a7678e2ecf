// SPDX-License-Identifier: Apache-2.0
// What a surface reflects under a thin film (KHR_materials_iridescence): Belcour and Barla, "A Practical Extension to Microfacet Theory for the Modeling
// of Varying Iridescence", 2017. Waves that went through the film and back m times interfere. In the visible band their sum is weighted by
// the eye's sensitivities, to the third term, and scaled so that what reflects all waves alike is grey; in the infrared band it is Airy's sum at 850 nm.
#ifndef KUAFU_THIN_FILM_GLSL
#define KUAFU_THIN_FILM_GLSL
#include "lib/microfacet.glsl"
#include "lib/spectrum.glsl"
#include "shared/wave.h"

struct ThinFilm {
  float weight;  // of the surface that wears it
  float ior, thickness_nm;
};

bool wears_thin_film(IN(ThinFilm) f) { return (features & feature_iridescence) != 0u && f.weight > 0.0f; }

float thin_film_schlick(float f0, float cosine) { return f0 + (1.0f - f0) * schlick_weight(cosine); }

/// What does not depend on the base that the film lies on, at one cosine.
struct ThinFilmWaves {
  float ior, r12;  // what its upper side reflects
  float cos_2;     // in the film
  Spectrum first, second, third;  // sensitivities to waves that went through it and back once, twice, three times; infrared: cosine of the first's phase
};

#if KUAFU_CHANNELS == 1
const float infrared_um = 0.85f;
float thin_film_sensitivity(float way_um) { return cos(2.0f * pi * way_um / infrared_um); }

/// Airy's sum.
float thin_film_channel(IN(ThinFilmWaves) w, float f0, float first, float second, float third) {
  float root = sqrt(clamp(f0, 0.0f, 0.9999f)), base = (1.0f + root) / (1.0f - root), part = (base - w.ior) / (base + w.ior);
  float r23 = thin_film_schlick(part * part, w.cos_2), both = 2.0f * sqrt(w.r12 * r23) * (base < w.ior ? -first : first);
  return clamp((w.r12 + r23 + both) / (1.0f + w.r12 * r23 + both), 0.0f, 1.0f);
}
#else
/// The eye's sensitivities to waves of this way, as parts of what white has of red, green and blue.
vec3 thin_film_sensitivity(float way_um) {
  float phase = 2.0f * pi * way_um, p2 = phase * phase;
  float x = 0.8462022f * cos(1.6810f * phase) * exp(-4.3278e-3f * p2) + 0.1537978f * cos(2.2399f * phase) * exp(-4.5282e-3f * p2);
  float y = cos(1.7953f * phase) * exp(-9.3046e-3f * p2), z = cos(2.2084f * phase) * exp(-6.6121e-3f * p2);
  return vec3((3.2404542f * x - 1.5371385f * y - 0.4985314f * z) / 1.2047844f, (-0.9692660f * x + 1.8760108f * y + 0.0415560f * z) / 0.9483008f,
              (0.0556434f * x - 0.2040259f * y + 1.0572252f * z) / 0.9088427f);
}

/// The sum's mean, and its next three terms times their sensitivities.
float thin_film_channel(IN(ThinFilmWaves) w, float f0, float first, float second, float third) {
  float root = sqrt(clamp(f0, 0.0f, 0.9999f)), base = (1.0f + root) / (1.0f - root), part = (base - w.ior) / (base + w.ior);
  float r23 = thin_film_schlick(part * part, w.cos_2), r123 = w.r12 * r23, through = (1.0f - w.r12) * (1.0f - w.r12) * r23 / (1.0f - r123);
  float step = sqrt(r123) * (base < w.ior ? 1.0f : -1.0f), term = through - (1.0f - w.r12);
  return clamp(w.r12 + through + 2.0f * term * step * (first + step * (second + step * third)), 0.0f, 1.0f);
}
#endif

/// The cosine is that outside.
ThinFilmWaves thin_film_waves(IN(ThinFilm) f, float cosine) {
  float c = clamp(cosine, 0.0f, 1.0f), r0 = (f.ior - 1.0f) / (f.ior + 1.0f);
  ThinFilmWaves w;
  w.ior = f.ior;
  w.r12 = thin_film_schlick(r0 * r0, c);
  w.cos_2 = sqrt(max(1.0f - (1.0f - c * c) / (f.ior * f.ior), 0.0f));
  float way_um = 2e-3f * f.ior * f.thickness_nm * w.cos_2;
  w.first = thin_film_sensitivity(way_um);
  w.second = thin_film_sensitivity(2.0f * way_um);
  w.third = thin_film_sensitivity(3.0f * way_um);
  return w;
}

/// Over a base that reflects f0 at normal incidence without the film.
Spectrum thin_film_over(IN(ThinFilmWaves) w, Spectrum f0) {
  Spectrum sum = Spectrum(0.0f);
  for (uint c = 0u; c < channels; ++c)
    set_channel(sum, c, thin_film_channel(w, channel_of(f0, c), channel_of(w.first, c), channel_of(w.second, c), channel_of(w.third, c)));
  return sum;
}

Spectrum thin_film_reflectance(IN(ThinFilm) f, Spectrum f0, float cosine) { return thin_film_over(thin_film_waves(f, cosine), f0); }

// Gauss's rule of three points for means over the hemisphere.
float gauss_cosine(int i) { return i == 0 ? 0.33571f : i == 1 ? 0.70711f : 0.94196f; }
float gauss_weight(int i) { return i == 1 ? 8.0f / 18.0f : 5.0f / 18.0f; }

Spectrum thin_film_mean(IN(ThinFilm) f, Spectrum f0) {
  Spectrum sum = Spectrum(0.0f);
  for (int i = 0; i < 3; ++i) sum += thin_film_reflectance(f, f0, gauss_cosine(i)) * gauss_weight(i);
  return sum;
}
#endif
