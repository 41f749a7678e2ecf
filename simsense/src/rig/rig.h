// SPDX-License-Identifier: Apache-2.0
// The stereo rig as the stages use it: pinholes, the rays of their lenses' pixels (ks/lens.hpp), rigid transforms, and the checks of a
// simsense_rig_desc.
#pragma once

#include <array>
#include <cstdint>

#include "simsense/simsense.h"

namespace simsense {

struct Pinhole {
  double fx = 0, fy = 0, cx = 0, cy = 0;
};

using Rotation = std::array<double, 9>;  // row-major 3x3

/// A rigid motion: to = rotation * from + translation (metres).
struct Rigid {
  Rotation rotation{1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 3> translation{};
};

Pinhole pinhole(const simsense_camera& camera);
/// Whether the lens differs from an ideal pinhole.
bool is_distorting(const ks_lens& lens);
Rigid rigid(const double matrix[16]);
/// Returns c with c(x) = a(b(x)).
Rigid compose(const Rigid& a, const Rigid& b);
Rotation transposed(const Rotation& r);
/// Angle of a rotation, radians.
double rotation_angle(const Rotation& r);

/// Throws KS_ERROR_INVALID_ARGUMENT for an invalid rig, with the field and its value.
void check_rig(const simsense_rig_desc& rig);

/// Normalised coordinates, x / z and y / z of a ray.
using Normalised = std::array<double, 2>;

/// Returns a pixel's ray by Newton's method. Where the lens has folded back there is none; the pixel's ray without a lens is then returned.
Normalised ray_of_pixel(const simsense_camera& camera, double u, double v);

/// Returns a pixel's ray by `steps` fixed-point steps ray <- (pixel - tangential) / radial (Heikkila and Silven, A four-step camera
/// calibration procedure, CVPR 1997). OpenCV's undistortPoints takes five. A fisheye lens uses ray_of_pixel().
Normalised ray_of_pixel_by_steps(const simsense_camera& camera, double u, double v, int steps);

}  // namespace simsense
