// SPDX-License-Identifier: Apache-2.0
#include "rig/rig.h"

#include <algorithm>
#include <cmath>

#include "device/error.h"
#include "device/field_check.h"
#include "ks/lens.hpp"

namespace simsense {
namespace {

constexpr uint32_t min_size = 32, max_size = 16384;
// Beyond these it is a slip of units or of order, not a camera.
constexpr double min_focal_sizes = 0.01 /* of the image's longer side */, max_focal_px = 1e7, max_aspect = 10, max_centre_sizes = 100;
constexpr double orthonormal_tolerance = 1e-3;  // calibration files are often written with few digits

void check_intrinsics(const simsense_camera& camera, const char* name) {
  const double* k = camera.k;
  const double size = std::max(camera.width, camera.height), least = min_focal_sizes * size, farthest = max_centre_sizes * size;
  if (std::min(k[0], k[4]) < least || std::max(k[0], k[4]) > max_focal_px || std::max(k[0] / k[4], k[4] / k[0]) > max_aspect)
    ks::fail(
        KS_ERROR_INVALID_ARGUMENT,
        "%s camera: focal lengths fx = %g, fy = %g pixels: must be %g..%g and within a factor of %g of each other for %ux%u pixels; K is "
        "in pixels",
        name, k[0], k[4], least, max_focal_px, max_aspect, camera.width, camera.height);
  if (std::abs(k[2]) > farthest || std::abs(k[5]) > farthest)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s camera: principal point %g, %g pixels: must be within %g of the origin for %ux%u pixels", name,
             k[2], k[5], farthest, camera.width, camera.height);
}

void check_camera(const simsense_camera& camera, const char* name, uint32_t smallest) {
  if (camera.width < smallest || camera.height < smallest || camera.width > max_size || camera.height > max_size)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s camera is %ux%u pixels: each side must be %u..%u", name, camera.width, camera.height, smallest,
             max_size);
  for (int i = 0; i < 9; ++i)
    if (!std::isfinite(camera.k[i])) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s camera: k[%d] = %g is not finite", name, i, camera.k[i]);
  const double* k = camera.k;
  if (!(k[0] > 0) || !(k[4] > 0))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s camera: focal lengths fx = %g, fy = %g pixels must be > 0", name, k[0], k[4]);
  if (k[1] != 0 || k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1)
    ks::fail(KS_ERROR_INVALID_ARGUMENT,
             "%s camera: k = [%g %g %g; %g %g %g; %g %g %g] must be [fx 0 cx; 0 fy cy; 0 0 1], row-major, without skew", name, k[0], k[1],
             k[2], k[3], k[4], k[5], k[6], k[7], k[8]);
  check_intrinsics(camera, name);
  ks::check_lens(std::string(name) + " camera: ", camera.lens.model, camera.lens.distortion);
}

void check_rigid(const double m[16], const char* name) {
  for (int i = 0; i < 16; ++i)
    if (!std::isfinite(m[i])) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s[%d] = %g is not finite", name, i, m[i]);
  if (m[12] != 0 || m[13] != 0 || m[14] != 0 || m[15] != 1)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s: last row is [%g %g %g %g], must be [0 0 0 1] (row-major 4x4)", name, m[12], m[13], m[14],
             m[15]);
  for (int i = 0; i < 3; ++i)
    for (int j = i; j < 3; ++j) {
      const double dot = m[4 * i] * m[4 * j] + m[4 * i + 1] * m[4 * j + 1] + m[4 * i + 2] * m[4 * j + 2];
      if (std::abs(dot - (i == j)) > orthonormal_tolerance)
        ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s: rows %d and %d of its rotation have the product %g, must be %d: not a rotation", name, i,
                 j, dot, i == j);
    }
  const double determinant = m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) + m[2] * (m[4] * m[9] - m[5] * m[8]);
  if (determinant < 0) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s: its rotation has determinant %g, must be 1: it mirrors", name, determinant);
}

Normalised without_lens(const simsense_camera& camera, double u, double v) {
  return {(u - camera.k[2]) / camera.k[0], (v - camera.k[5]) / camera.k[4]};
}

}  // namespace

Pinhole pinhole(const simsense_camera& camera) { return {camera.k[0], camera.k[4], camera.k[2], camera.k[5]}; }

bool is_distorting(const ks_lens& lens) {
  return lens.model != KS_LENS_BROWN_CONRADY || std::ranges::any_of(lens.distortion, [](double k) { return k != 0; });
}

Rigid rigid(const double m[16]) {
  Rigid r;
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = 0; j < 3; ++j) r.rotation[3 * i + j] = m[4 * i + j];
    r.translation[i] = m[4 * i + 3];
  }
  return r;
}

Rigid compose(const Rigid& a, const Rigid& b) {
  Rigid c;
  for (size_t i = 0; i < 3; ++i) {
    c.translation[i] = a.translation[i];
    for (size_t j = 0; j < 3; ++j) {
      c.rotation[3 * i + j] = 0;
      for (size_t k = 0; k < 3; ++k) c.rotation[3 * i + j] += a.rotation[3 * i + k] * b.rotation[3 * k + j];
      c.translation[i] += a.rotation[3 * i + j] * b.translation[j];
    }
  }
  return c;
}

Rotation transposed(const Rotation& r) { return {r[0], r[3], r[6], r[1], r[4], r[7], r[2], r[5], r[8]}; }

double rotation_angle(const Rotation& r) {
  // Half the norm of the antisymmetric part is the sine: exact for the small angles where the trace's cosine is flat.
  const double sine = 0.5 * std::hypot(r[7] - r[5], r[2] - r[6], r[3] - r[1]);
  return std::atan2(sine, 0.5 * (r[0] + r[4] + r[8] - 1));
}

void check_rig(const simsense_rig_desc& rig) {
  check_camera(rig.left, "left", min_size);
  check_camera(rig.right, "right", min_size);
  if (rig.left.width != rig.right.width || rig.left.height != rig.right.height)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "left camera is %ux%u pixels, right is %ux%u: both must have one size", rig.left.width,
             rig.left.height, rig.right.width, rig.right.height);
  check_rigid(rig.left_to_right, "left_to_right");
  if (rig.rgb.width != 0 || rig.rgb.height != 0) {
    check_camera(rig.rgb, "rgb", 1);
    check_rigid(rig.left_to_rgb, "left_to_rgb");
  }
  if (rig.faults & ~SIMSENSE_FAULTS_PUBLISHED)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "faults is 0x%x: only the bits of 0x%x are known", rig.faults, SIMSENSE_FAULTS_PUBLISHED);
  if ((rig.faults & SIMSENSE_FAULT_REGISTRATION_UNRECTIFIED) && is_distorting(rig.rgb.lens))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "rgb.lens.distortion[0] = %g with the fault registration_unrectified: that one knows no lenses",
             rig.rgb.lens.distortion[0]);
  if (rig.back_end > SIMSENSE_BACK_END_VULKAN)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "back_end is %u: must be auto (0), cpu (1) or vulkan (2)", rig.back_end);
  if (rig.batch_count < 1) ks::fail(KS_ERROR_INVALID_ARGUMENT, "batch_count is %u: must be at least 1", rig.batch_count);
}

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
