// SPDX-License-Identifier: Apache-2.0
// From a pixel back to the ray that its lens (ks/lens.hpp) bent there. Thread rule: pure functions.
#pragma once

#include <array>

#include "ks/lens.hpp"
#include "rig/rig.h"

namespace simsense {

/// Normalised coordinates, x / z and y / z of a ray.
using Normalised = std::array<double, 2>;

/// Returns a pixel's ray by Newton's method. Where the lens has folded back there is none; the pixel's ray without a lens is then returned.
Normalised ray_of_pixel(const simsense_camera& camera, double u, double v);

/// Returns a pixel's ray by `steps` fixed-point steps ray <- (pixel - tangential) / radial (Heikkila and Silven, A four-step camera
/// calibration procedure, CVPR 1997). OpenCV's undistortPoints takes five. A fisheye lens uses ray_of_pixel().
Normalised ray_of_pixel_by_steps(const simsense_camera& camera, double u, double v, int steps);

}  // namespace simsense
