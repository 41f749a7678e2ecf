// How alike two pixels are, as exponents of a falling weight.
#ifndef KUAFU_ALIKE_GLSL
#define KUAFU_ALIKE_GLSL
#include "shared/denoise_record.h"

const float unlike = 8.0f;  // and beyond: weight 0

/// words: of an array of GuideRecord.
void store_guide(UintArray words, uint index, GuideRecord g) {
  uint word = index * 12u;
  for (int k = 0; k < 3; ++k) {
    words.at[word + uint(k)] = floatBitsToUint(g.normal[k]);
    words.at[word + 4u + uint(k)] = floatBitsToUint(g.position[k]);
    words.at[word + 8u + uint(k)] = floatBitsToUint(g.albedo[k]);
  }
  words.at[word + 3u] = g.material;
  words.at[word + 7u] = floatBitsToUint(g.footprint_m);
  words.at[word + 11u] = floatBitsToUint(g.normal_exponent);
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
  return exponent * max(0.0f, 1.0f - dot(a.normal, b.normal)) + off_plane / (0.5f * (mixed ? max(a.footprint_m, b.footprint_m) : a.footprint_m) * max(pixels, 1.0f) + 1e-9f);
}
#endif
