// How alike two pixels are, as exponents of a falling weight.
#ifndef KUAFU_ALIKE_GLSL
#define KUAFU_ALIKE_GLSL
#include "shared/denoise_record.h"

const float unlike = 8.0f;  // and beyond: weight 0

/// (1 - t/8)^8 for exp(-t): cheaper, and it ends.
float falling(float t) {
  float a = max(0.0f, 1.0f - t / unlike);
  a *= a;
  a *= a;
  return a * a;
}

/// Surfaces `pixels` apart: other material, turned normal, or off the tangent plane by more than the pixels can tell.
float surface_unlike(GuideRecord a, GuideRecord b, float pixels, float most_exponent) {
  if (a.material != b.material) return unlike;
  if (a.material == miss) return 0.0f;
  float exponent = min(most_exponent, max(a.normal_exponent, b.normal_exponent));
  float off_plane = abs(dot(b.position - a.position, a.normal));
  return exponent * max(0.0f, 1.0f - dot(a.normal, b.normal)) + off_plane / (0.5f * a.footprint_m * max(pixels, 1.0f) + 1e-9f);
}
#endif
