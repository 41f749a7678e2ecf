// SPDX-License-Identifier: Apache-2.0
#include "rig/undistort.h"

#include <cmath>

namespace simsense {
namespace {

struct BrownConrady {
  double k1, k2, p1, p2, k3, k4, k5, k6;
  explicit BrownConrady(const double* d) : k1(d[0]), k2(d[1]), p1(d[2]), p2(d[3]), k3(d[4]), k4(d[5]), k5(d[6]), k6(d[7]) {}

  [[nodiscard]] double over(double r2) const { return 1 + r2 * (k1 + r2 * (k2 + r2 * k3)); }
  [[nodiscard]] double under(double r2) const { return 1 + r2 * (k4 + r2 * (k5 + r2 * k6)); }
  [[nodiscard]] double radial(double r2) const { return over(r2) / under(r2); }
  /// d radial / d r2
  [[nodiscard]] double slope(double r2) const {
    const double over_slope = k1 + r2 * (2 * k2 + r2 * 3 * k3), under_slope = k4 + r2 * (2 * k5 + r2 * 3 * k6);
    return (over_slope - radial(r2) * under_slope) / under(r2);
  }
  [[nodiscard]] Normalised tangential(double x, double y) const {
    const double r2 = x * x + y * y;
    return {2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
  }
  [[nodiscard]] Normalised operator()(double x, double y) const {
    const double factor = radial(x * x + y * y);
    const Normalised bend = tangential(x, y);
    return {x * factor + bend[0], y * factor + bend[1]};
  }
};

struct Fisheye {
  double k1, k2, k3, k4;
  explicit Fisheye(const double* d) : k1(d[0]), k2(d[1]), k3(d[2]), k4(d[3]) {}

  /// The image radius of a ray at this angle from the axis.
  [[nodiscard]] double radius(double angle) const {
    const double a2 = angle * angle;
    return angle * (1 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))));
  }
  /// d radius / d angle
  [[nodiscard]] double slope(double angle) const {
    const double a2 = angle * angle;
    return 1 + a2 * (3 * k1 + a2 * (5 * k2 + a2 * (7 * k3 + a2 * 9 * k4)));
  }
  [[nodiscard]] Normalised operator()(double x, double y) const {
    const double tangent = std::hypot(x, y), scale = tangent > 1e-9 ? radius(std::atan(tangent)) / tangent : 1;
    return {x * scale, y * scale};
  }
};

constexpr double right_angle = 1.5707963267948966;

/// By Newton's method; where no ray before the camera appears there, the position itself.
Normalised undistorted(const Fisheye& lens, const Normalised& seen) {
  const double radius = std::hypot(seen[0], seen[1]);
  if (radius < 1e-9) return seen;
  double angle = radius;
  for (int step = 0; step < 50; ++step) {
    const double off = lens.radius(angle) - radius;
    if (std::abs(off) < 1e-14 * (1 + radius)) break;
    angle -= off / lens.slope(angle);
  }
  if (!(std::abs(lens.radius(angle) - radius) < 1e-9) || !(angle > 0 && angle < right_angle)) return seen;
  const double scale = std::tan(angle) / radius;
  return {seen[0] * scale, seen[1] * scale};
}

Normalised without_lens(const simsense_camera& camera, double u, double v) {
  return {(u - camera.k[2]) / camera.k[0], (v - camera.k[5]) / camera.k[4]};
}

}  // namespace

Normalised distorted(const ks_lens& lens, const Normalised& ray) {
  if (lens.model == KS_LENS_KANNALA_BRANDT) return Fisheye(lens.distortion)(ray[0], ray[1]);
  return BrownConrady(lens.distortion)(ray[0], ray[1]);
}

double fold_radius2(const ks_lens& distortion) {
  if (distortion.model == KS_LENS_KANNALA_BRANDT) {
    const Fisheye lens(distortion.distortion);
    for (double angle = 0; angle < right_angle; angle += 1e-4)
      if (!(lens.slope(angle) > 0)) return std::tan(angle) * std::tan(angle);
    return 1e8;
  }
  const BrownConrady lens(distortion.distortion);
  for (double r = 0; r < 10; r += 1e-3) {
    const double r2 = r * r;
    if (!(lens.under(r2) > 0 && lens.radial(r2) + 2 * r2 * lens.slope(r2) > 0)) return r2;
  }
  return 100;
}

Normalised ray_of_pixel(const simsense_camera& camera, double u, double v) {
  const Normalised seen = without_lens(camera, u, v);
  if (camera.lens.model == KS_LENS_KANNALA_BRANDT) return undistorted(Fisheye(camera.lens.distortion), seen);
  const BrownConrady lens(camera.lens.distortion);
  const double close_enough = 1e-13 * (1 + std::hypot(seen[0], seen[1]));
  auto [x, y] = seen;
  for (int step = 0; step < 50; ++step) {
    const double r2 = x * x + y * y, factor = lens.radial(r2), slope = lens.slope(r2);
    const Normalised now = lens(x, y);
    const double ex = seen[0] - now[0], ey = seen[1] - now[1];
    if (std::hypot(ex, ey) < close_enough) return {x, y};
    const double xx = factor + 2 * x * x * slope + 2 * lens.p1 * y + 6 * lens.p2 * x;
    const double xy = 2 * x * y * slope + 2 * lens.p1 * x + 2 * lens.p2 * y;  // of x by y, and of y by x
    const double yy = factor + 2 * y * y * slope + 6 * lens.p1 * y + 2 * lens.p2 * x;
    const double determinant = xx * yy - xy * xy;
    if (!(determinant > 0)) return seen;  // beyond the fold, where the lens maps two rays onto one pixel
    x += (yy * ex - xy * ey) / determinant;
    y += (xx * ey - xy * ex) / determinant;
  }
  return seen;
}

Normalised ray_of_pixel_by_steps(const simsense_camera& camera, double u, double v, int steps) {
  if (camera.lens.model == KS_LENS_KANNALA_BRANDT) return ray_of_pixel(camera, u, v);
  const BrownConrady lens(camera.lens.distortion);
  const Normalised seen = without_lens(camera, u, v);
  auto [x, y] = seen;
  for (int step = 0; step < steps; ++step) {
    const double r2 = x * x + y * y, inverse = lens.under(r2) / lens.over(r2);
    if (inverse < 0) return seen;
    const Normalised bend = lens.tangential(x, y);
    x = (seen[0] - bend[0]) * inverse;
    y = (seen[1] - bend[1]) * inverse;
  }
  return {x, y};
}

}  // namespace simsense
