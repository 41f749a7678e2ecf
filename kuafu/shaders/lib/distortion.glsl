// SPDX-License-Identifier: Apache-2.0
// Brown and Conrady's lens distortion, rational: k1 k2 p1 p2 k3 k4 k5 k6 (OpenCV's order), at z = 1.
#ifndef KUAFU_DISTORTION_GLSL
#define KUAFU_DISTORTION_GLSL
#include "lib/language.glsl"
#include "shared/camera_record.h"

/// Where the ray through `p` appears.
vec2 distort(const float k[8], vec2 p) {
  float r2 = dot(p, p);
  float radial = (1.0f + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (1.0f + r2 * (k[5] + r2 * (k[6] + r2 * k[7])));
  return vec2(p.x * radial + 2.0f * k[2] * p.x * p.y + k[3] * (r2 + 2.0f * p.x * p.x),
              p.y * radial + k[2] * (r2 + 2.0f * p.y * p.y) + 2.0f * k[3] * p.x * p.y);
}

/// Its derivative, which is symmetric: d x'/dx, d x'/dy = d y'/dx, d y'/dy.
vec3 distortion_slope(const float k[8], vec2 p) {
  float r2 = dot(p, p);
  float under = 1.0f + r2 * (k[5] + r2 * (k[6] + r2 * k[7])), radial = (1.0f + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / under;
  float slope = 2.0f * (k[0] + r2 * (2.0f * k[1] + 3.0f * r2 * k[4]) - radial * (k[5] + r2 * (2.0f * k[6] + 3.0f * r2 * k[7]))) / under;
  return vec3(radial + p.x * p.x * slope + 2.0f * k[2] * p.y + 6.0f * k[3] * p.x, p.x * p.y * slope + 2.0f * (k[2] * p.x + k[3] * p.y),
              radial + p.y * p.y * slope + 6.0f * k[2] * p.y + 2.0f * k[3] * p.x);
}

/// The ray that appears at `q`, by Newton's method, to the rounding of floats. Where the lens folds back there is none; the host refuses such images.
vec2 undistort(const float k[8], vec2 q) {
  vec2 p = q;
  for (uint i = 0u; i < undistort_steps; ++i) {
    vec2 e = distort(k, p) - q;
    if (dot(e, e) < 1e-13f * (1.0f + dot(q, q))) break;
    vec3 j = distortion_slope(k, p);
    p -= vec2(j.z * e.x - j.y * e.y, j.x * e.y - j.y * e.x) / (j.x * j.z - j.y * j.y);
  }
  return p;
}
#endif
