// SPDX-License-Identifier: Apache-2.0
// How alike two pixels are, as exponents of a falling weight.
#ifndef KUAFU_ALIKE_GLSL
#define KUAFU_ALIKE_GLSL
#include "lib/language.glsl"
#include "shared/denoise_record.h"

// Tuned as the numbers of stage/denoise.glsl are.
const float unlike = 8.0f;            // and beyond: weight 0
const float any_exponent = 1e9f;      // of normals: that of the surface counts
const float matt_exponent = 32.0f;    // of normals, on rough surfaces: the weight is 1/e where they are 14 degrees apart
const float plane_reach = 0.5f;       // of a pixel's footprint: neighbours so far off the tangent plane differ by 1
const float least_length_m = 1e-9f;   // keeps divisions finite where nothing was hit
const float square_reach_px = 2.0f;   // apart that a ray over a pixel's square and a neighbour's centre may be

void store_guide_part(UintArray words, uint pixel, uint k, vec3 v, uint w) {
  uint word = guide_place(pixel, k) * 4u;
  for (int i = 0; i < 3; ++i) words.at[word + uint(i)] = floatBitsToUint(v[i]);
  words.at[word + 3u] = w;
}

/// words: a GuideArray.
void store_guide(UintArray words, uint pixel, GuideRecord g) {
  store_guide_part(words, pixel, 0u, g.normal, g.material);
  store_guide_part(words, pixel, 1u, g.position, floatBitsToUint(g.normal_exponent));
  store_guide_part(words, pixel, 2u, g.albedo, floatBitsToUint(g.footprint_m));
}

/// What surface_unlike compares of a neighbour: no albedo, and the footprint of blurred pixels alone.
GuideRecord load_surface(GuideArray guides, uint pixel) {
  GuideRecord g;
  vec4 a = guides.at[guide_place(pixel, 0u)], b = guides.at[guide_place(pixel, 1u)];
  g.normal = xyz(a);
  g.material = floatBitsToUint(a.w);
  g.position = xyz(b);
  g.normal_exponent = b.w;
  g.albedo = vec3(0.0f);
  g.footprint_m = 0.0f;
  if (g.material == mixed_materials) g.footprint_m = guides.at[guide_place(pixel, 2u)].w;
  return g;
}

GuideRecord load_guide(GuideArray guides, uint pixel) {
  GuideRecord g = load_surface(guides, pixel);
  vec4 c = guides.at[guide_place(pixel, 2u)];
  g.albedo = xyz(c);
  g.footprint_m = c.w;
  return g;
}

/// (1 - t/8)^8 for exp(-t): cheaper, and it ends.
float falling(float t) {
  float a = max(0.0f, 1.0f - t / unlike);
  a *= a;
  a *= a;
  return a * a;
}

/// Surfaces `pixels` apart: other material, turned normal, or off the tangent plane by more than the pixels can tell.
float surface_unlike(GuideRecord a, GuideRecord b, float pixels, float most_exponent) {
  bool mixed = a.material == mixed_materials || b.material == mixed_materials;
  if (a.material != b.material && (!mixed || a.material == miss || b.material == miss)) return unlike;
  if (a.material == miss) return 0.0f;
  float exponent = min(most_exponent, max(a.normal_exponent, b.normal_exponent));
  float off_plane = abs(dot(b.position - a.position, a.normal));
  return exponent * max(0.0f, 1.0f - dot(a.normal, b.normal)) + off_plane / (plane_reach * (mixed ? max(a.footprint_m, b.footprint_m) : a.footprint_m) * max(pixels, 1.0f) + least_length_m);
}
#endif
