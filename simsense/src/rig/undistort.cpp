// SPDX-License-Identifier: Apache-2.0
#include "rig/undistort.h"

namespace simsense {
namespace {

Normalised without_lens(const simsense_camera& camera, double u, double v) {
  return {(u - camera.k[2]) / camera.k[0], (v - camera.k[5]) / camera.k[4]};
}

}  // namespace

Normalised ray_of_pixel(const simsense_camera& camera, double u, double v) {
  const Normalised seen = without_lens(camera, u, v);
  const ks::LensRay ray = ks::undistorted(camera.lens, seen[0], seen[1]);
  return ray.exists ? Normalised{ray.x, ray.y} : seen;
}

Normalised ray_of_pixel_by_steps(const simsense_camera& camera, double u, double v, int steps) {
  if (camera.lens.model == KS_LENS_KANNALA_BRANDT) return ray_of_pixel(camera, u, v);
  const Normalised seen = without_lens(camera, u, v);
  auto [x, y] = seen;
  for (int step = 0; step < steps; ++step) {
    const double factor = ks::lens_factor(camera.lens, x * x + y * y).value;
    if (!(factor > 0)) return seen;
    const ks::LensShift shift = ks::lens_shift(camera.lens, x, y);
    x = (seen[0] - shift.x) / factor;
    y = (seen[1] - shift.y) / factor;
  }
  return {x, y};
}

}  // namespace simsense
