// SPDX-License-Identifier: Apache-2.0
// A lens' distortion of a ray (x, y, 1) in single precision (ks/lens.h), read by GLSL and C++: one text, and the same bits on every device.
// It has only sums, products and exact quotients, for devices' own roots and arc tangents differ.
#ifndef SIMSENSE_LENS_H
#define SIMSENSE_LENS_H

#ifdef __cplusplus
#include <bit>
#include <cstdint>

namespace simsense {
#define SIMSENSE_FN inline
#define SIMSENSE_OUT float&
#define SIMSENSE_EXACT float
inline uint32_t floatBitsToUint(float value) { return std::bit_cast<uint32_t>(value); }
inline float uintBitsToFloat(uint32_t bits) { return std::bit_cast<float>(bits); }
inline float exact_quotient(float a, float b) { return a / b; }
#define SIMSENSE_UINT uint32_t
#else
#include "lib/exact_ratio.glsl"
#define SIMSENSE_FN
#define SIMSENSE_OUT inout float
#define SIMSENSE_EXACT precise float
#define SIMSENSE_UINT uint
#endif

struct LensParameters {
  SIMSENSE_UINT model;  // KS_LENS_*
  float k[8];           // k1 k2 p1 p2 k3 k4 k5 k6, or k1 k2 k3 k4
  float max_radius2;    // x^2 + y^2 from which on the lens has folded back; 0: there is no lens
};

/// 1 / sqrt(x) by Newton's method, of x > 0; the first guess halves the exponent.
SIMSENSE_FN float inverse_root(float x) {
  SIMSENSE_EXACT y = uintBitsToFloat(0x5f3759dfu - (floatBitsToUint(x) >> 1)), half_x = 0.5f * x;
  for (int i = 0; i < 4; ++i) y = y * (1.5f - half_x * y * y);
  return y;
}

/// atan(x) / x, of 0..1, to 1e-7: the Chebyshev fit of degree 8 in x^2.
SIMSENSE_FN float arc_tangent_ratio(float x2) {
  SIMSENSE_EXACT low = 1.0f + x2 * (-0.33333066f + x2 * (0.19992484f + x2 * (-0.14202571f + x2 * 0.10636754f)));
  SIMSENSE_EXACT high = -0.07495446f + x2 * (0.042587608f + x2 * (-0.01600503f + x2 * 0.0028340644f)), x4 = x2 * x2;
  return low + x4 * x4 * x2 * high;
}

/// By how much a fisheye lens scales a ray of this x^2 + y^2.
SIMSENSE_FN float fisheye_scale(LensParameters lens, float r2) {
  if (!(r2 > 1e-8f)) return 1.0f;
  SIMSENSE_EXACT inverse = inverse_root(r2), tangent = r2 > 1.0f ? inverse : r2 * inverse;
  SIMSENSE_EXACT near = tangent * arc_tangent_ratio(tangent * tangent);
  SIMSENSE_EXACT angle = r2 > 1.0f ? 1.5707964f - near : near, a2 = angle * angle;
  SIMSENSE_EXACT radius = angle * (1.0f + a2 * (lens.k[0] + a2 * (lens.k[1] + a2 * (lens.k[2] + a2 * lens.k[3]))));
  return radius * inverse;
}

/// false where the lens has folded back: such a point is far outside the lens' field, though its image may land inside.
SIMSENSE_FN bool distort(LensParameters lens, SIMSENSE_OUT x, SIMSENSE_OUT y) {
  SIMSENSE_EXACT r2 = x * x + y * y;
  if (!(r2 < lens.max_radius2)) return false;
  if (lens.model == 1u) {
    SIMSENSE_EXACT scale = fisheye_scale(lens, r2);
    x = x * scale;
    y = y * scale;
    return true;
  }
  SIMSENSE_EXACT over = 1.0f + r2 * (lens.k[0] + r2 * (lens.k[1] + r2 * lens.k[4]));
  SIMSENSE_EXACT under = 1.0f + r2 * (lens.k[5] + r2 * (lens.k[6] + r2 * lens.k[7]));
  SIMSENSE_EXACT radial = exact_quotient(over, under), xy2 = 2.0f * x * y;
  SIMSENSE_EXACT distorted_x = x * radial + lens.k[2] * xy2 + lens.k[3] * (r2 + 2.0f * x * x);
  SIMSENSE_EXACT distorted_y = y * radial + lens.k[2] * (r2 + 2.0f * y * y) + lens.k[3] * xy2;
  x = distorted_x;
  y = distorted_y;
  return true;
}

#ifdef __cplusplus
}  // namespace simsense
#endif
#endif
