// SPDX-License-Identifier: Apache-2.0
/* A lens (ks/lens.h) in C++17, double precision: where a ray (x, y, 1) appears, and the ray that appears at a position. Both libraries and
 * both Python modules use this one text. Brown, Decentering distortion of lenses, Photogrammetric Engineering 32(3), 1966; Kannala and Brandt,
 * A generic camera model and calibration method for conventional, wide-angle, and fish-eye lenses, 2006. */
#ifndef KS_LENS_HPP
#define KS_LENS_HPP

#include <algorithm>
#include <cmath>
#include <limits>

#include "ks/lens.h"

namespace ks {

/* A number and its derivative. */
struct LensValue {
  double value, slope;
};

/* The radial factor of Brown and Conrady's lens at the squared radius r2, and its derivative by r2. */
inline LensValue lens_factor(const ks_lens& lens, double r2) {
  const double* k = lens.distortion;
  const double under = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])), value = (1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / under;
  return {value, (k[0] + r2 * (2 * k[1] + r2 * 3 * k[4]) - value * (k[5] + r2 * (2 * k[6] + r2 * 3 * k[7]))) / under};
}

/* The shift of a ray's position by Brown and Conrady's p1 and p2. */
struct LensShift {
  double x, y;
};
inline LensShift lens_shift(const ks_lens& lens, double x, double y) {
  const double p1 = lens.distortion[2], p2 = lens.distortion[3], r2 = x * x + y * y;
  return {2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
}

/* The image radius of a fisheye lens at an angle from its axis. */
inline LensValue fisheye_radius(const ks_lens& lens, double angle) {
  const double *k = lens.distortion, a2 = angle * angle;
  return {angle * (1 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3])))),
          1 + a2 * (3 * k[0] + a2 * (5 * k[1] + a2 * (7 * k[2] + a2 * 9 * k[3])))};
}

/* The squared radius x^2 + y^2 of the first rays that the lens no longer bends farther out than their neighbours within, or where its
 * denominator is 0: from there on it shows the scene a second time, folded. Where it does not fold: 100 (84 degrees off the axis), of a fisheye
 * lens 1e8. last_radius2: of a ray just within, infinite where the lens does not fold. */
struct LensFold {
  double radius2, last_radius2;
};
inline LensFold lens_fold(const ks_lens& lens) {
  const bool fisheye = lens.model == KS_LENS_KANNALA_BRANDT;
  const double step = fisheye ? 1e-4 : 1e-3, end = fisheye ? 1.5707963267948966 : 10;
  double last = 0;
  for (int i = 0; i * step < end; ++i) {
    const double radius = fisheye ? std::tan(i * step) : i * step, r2 = radius * radius;
    bool grows = fisheye && fisheye_radius(lens, i * step).slope > 0;
    if (!fisheye) {
      const double *k = lens.distortion, under = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
      const LensValue factor = lens_factor(lens, r2);
      grows = under > 0 && factor.value + 2 * r2 * factor.slope > 0;
    }
    if (!grows) return {r2, last};
    last = r2;
  }
  return {fisheye ? 1e8 : 100.0, std::numeric_limits<double>::infinity()};
}

/* A ray's distorted position, and its derivatives by the ray, which are symmetric: d x'/dx, d x'/dy = d y'/dx, d y'/dy. */
struct LensImage {
  double x, y, xx, xy, yy;
  /* Growing in every direction: where this holds from the axis outwards, no two rays meet in one pixel. */
  [[nodiscard]] bool grows() const { return xx + yy > 0 && xx * yy > xy * xy; }
};
/* last_radius2: from there on the radial factor stays as it is, so that positions go on outwards. */
inline LensImage distorted(const ks_lens& lens, double x, double y, double last_radius2 = std::numeric_limits<double>::infinity()) {
  const bool fisheye = lens.model == KS_LENS_KANNALA_BRANDT;
  const double r2 = x * x + y * y, at = std::min(r2, last_radius2), beyond = r2 > last_radius2 ? 0 : 1;
  if (fisheye) {
    const double r = std::sqrt(at);
    const LensValue seen = fisheye_radius(lens, std::atan(r));
    const double g = r > 1e-9 ? seen.value / r : 1, slope = r > 1e-8 ? beyond * (seen.slope / (1 + at) - g) / at : 0;
    return {x * g, y * g, g + x * x * slope, x * y * slope, g + y * y * slope};
  }
  const LensValue g = lens_factor(lens, at);
  const LensShift shift = lens_shift(lens, x, y);
  const double p1 = lens.distortion[2], p2 = lens.distortion[3], slope = 2 * beyond * g.slope;
  return {x * g.value + shift.x, y * g.value + shift.y, g.value + x * x * slope + 2 * p1 * y + 6 * p2 * x,
          x * y * slope + 2 * p1 * x + 2 * p2 * y, g.value + y * y * slope + 6 * p1 * y + 2 * p2 * x};
}

/* The ray that appears at a position, by Newton's method in so many steps at most; last_radius2 as of distorted(). exists: false where there is none before the camera,
 * or where the lens has folded back; x and y are then the last step's. */
struct LensRay {
  double x, y;
  bool exists;
};
inline LensRay undistorted(const ks_lens& lens, double x, double y, double last_radius2 = std::numeric_limits<double>::infinity(), int steps = 50) {
  if (lens.model == KS_LENS_KANNALA_BRANDT) {
    const double radius = std::hypot(x, y), last = std::atan(std::sqrt(last_radius2));
    if (radius < 1e-9) return {x, y, true};
    double angle = std::min(radius, last);
    for (int i = 0; i < steps; ++i) {
      const LensValue seen = fisheye_radius(lens, angle);
      if (std::abs(seen.value - radius) < 1e-14 * (1 + radius)) break;
      angle = std::clamp(angle - (seen.value - radius) / std::max(seen.slope, 1e-9), 0.0, last);
    }
    const double scale = std::tan(angle) / radius;
    return {x * scale, y * scale, angle < 1.57079632 && std::abs(fisheye_radius(lens, angle).value - radius) < 1e-9};
  }
  LensRay ray{x, y, false};
  const double close_enough = 1e-13 * (1 + std::sqrt(x * x + y * y)), close_enough2 = close_enough * close_enough;
  for (int i = 0; i < steps && !ray.exists; ++i) {
    const LensImage now = distorted(lens, ray.x, ray.y, last_radius2);
    const double ex = x - now.x, ey = y - now.y, determinant = now.xx * now.yy - now.xy * now.xy;
    ray.exists = ex * ex + ey * ey < close_enough2;
    if (ray.exists || !(determinant > 0)) break;
    ray.x += (now.yy * ex - now.xy * ey) / determinant;
    ray.y += (now.xx * ey - now.xy * ex) / determinant;
  }
  return ray;
}

}  // namespace ks

#endif
