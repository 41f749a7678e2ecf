// SPDX-License-Identifier: Apache-2.0
// From a pixel back to the ray that its lens (ks/lens.hpp) bent there. Thread rule: pure functions.
#pragma once

#include <array>

#include "ks/lens.hpp"
#include "rig/rig.h"

namespace simsense {

/// Normalised coordinates, x / z and y / z of a ray.
using Normalised = std::array<double, 2>;

/// The ray of a pixel, by Newton's method. Where the lens has folded back there is none: the pixel's ray without a lens then.
Normalised ray_of_pixel(const simsense_camera& camera, double u, double v);

/// The same by a given number of the fixed-point steps ray <- (pixel - tangential) / radial of Heikkila and Silven (A four-step camera
/// calibration procedure, CVPR 1997): what OpenCV's undistortPoints takes, five of them by default. Of a fisheye lens as ray_of_pixel().
Normalised ray_of_pixel_by_steps(const simsense_camera& camera, double u, double v, int steps);

}  // namespace simsense
