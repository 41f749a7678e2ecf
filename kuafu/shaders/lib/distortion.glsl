// SPDX-License-Identifier: Apache-2.0
// Lens distortion at z = 1: Brown and Conrady's, rational, k1 k2 p1 p2 k3 k4 k5 k6 (OpenCV's order), and fisheye lenses, k1 k2 k3 k4 (Kannala and Brandt,
// "A Generic Camera Model and Calibration Method for Conventional, Wide-Angle, and Fish-Eye Lenses", 2006).
#ifndef KUAFU_DISTORTION_GLSL
#define KUAFU_DISTORTION_GLSL
#include "lib/language.glsl"
#include "shared/lens_record.h"

/// Radius at which a fisheye lens shows the angle, and its derivative.
vec2 fisheye_radius(const float k[8], float angle) {
  float a2 = angle * angle;
  return vec2(angle * (1.0f + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3])))),
              1.0f + a2 * (3.0f * k[0] + a2 * (5.0f * k[1] + a2 * (7.0f * k[2] + a2 * 9.0f * k[3]))));
}

/// Where the ray through `p` appears.
vec2 distort(IN(LensRecord) lens, vec2 p) {
  float r2 = dot(p, p);
  if (lens.model == lens_kannala_brandt) {
    float r = sqrt(r2);
    return r < 1e-4f ? p : p * (fisheye_radius(lens.k, atan(r)).x / r);
  }
  float radial = (1.0f + r2 * (lens.k[0] + r2 * (lens.k[1] + r2 * lens.k[4]))) / (1.0f + r2 * (lens.k[5] + r2 * (lens.k[6] + r2 * lens.k[7])));
  return vec2(p.x * radial + 2.0f * lens.k[2] * p.x * p.y + lens.k[3] * (r2 + 2.0f * p.x * p.x),
              p.y * radial + lens.k[2] * (r2 + 2.0f * p.y * p.y) + 2.0f * lens.k[3] * p.x * p.y);
}

/// The derivative of Brown and Conrady's, which is symmetric: d x'/dx, d x'/dy = d y'/dx, d y'/dy.
vec3 distortion_slope(const float k[8], vec2 p) {
  float r2 = dot(p, p);
  float under = 1.0f + r2 * (k[5] + r2 * (k[6] + r2 * k[7])), radial = (1.0f + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / under;
  float slope = 2.0f * (k[0] + r2 * (2.0f * k[1] + 3.0f * r2 * k[4]) - radial * (k[5] + r2 * (2.0f * k[6] + 3.0f * r2 * k[7]))) / under;
  return vec3(radial + p.x * p.x * slope + 2.0f * k[2] * p.y + 6.0f * k[3] * p.x, p.x * p.y * slope + 2.0f * (k[2] * p.x + k[3] * p.y),
              radial + p.y * p.y * slope + 6.0f * k[2] * p.y + 2.0f * k[3] * p.x);
}

vec2 undistort_fisheye(const float k[8], vec2 q) {
  float radius = length(q), angle = radius;
  if (radius < 1e-4f) return q;
  for (uint i = 0u; i < undistort_steps; ++i) {
    vec2 seen = fisheye_radius(k, angle);
    if (abs(seen.x - radius) < 3e-7f * (1.0f + radius)) break;
    angle -= (seen.x - radius) / seen.y;
  }
  return q * (tan(angle) / radius);
}

/// The ray that appears at `q`, by Newton's method, to the rounding of floats. Where the lens folds back there is none; the host refuses such images.
vec2 undistort(IN(LensRecord) lens, vec2 q) {
  if (lens.model == lens_straight) return q;
  if (lens.model == lens_kannala_brandt) return undistort_fisheye(lens.k, q);
  vec2 p = q;
  for (uint i = 0u; i < undistort_steps; ++i) {
    vec2 e = distort(lens, p) - q;
    if (dot(e, e) < 1e-13f * (1.0f + dot(q, q))) break;
    vec3 j = distortion_slope(lens.k, p);
    p -= vec2(j.z * e.x - j.y * e.y, j.x * e.y - j.y * e.x) / (j.x * j.z - j.y * j.y);
  }
  return p;
}
#endif
