// SPDX-License-Identifier: Apache-2.0
// From a pixel back to the ray that its lens bent there: the inverse of Brown-Conrady distortion (Brown, Decentering distortion of lenses,
// Photogrammetric Engineering 32(3), 1966), double precision. Thread rule: pure functions.
#pragma once

#include "rig/rig.h"

namespace simsense {

/// Normalised coordinates, x / z and y / z of a ray.
using Normalised = std::array<double, 2>;

/// What the lens makes of a ray.
Normalised distorted(const Distortion& lens, const Normalised& ray);

/// Squared radius x^2 + y^2 of the first rays that the radial distortion no longer bends farther out than their neighbours within, or
/// where its denominator is 0: from there on the lens shows the scene a second time, folded. 100 where it does not fold up to a radius of
/// 10 (84 degrees off axis).
double fold_radius2(const Distortion& lens);

/// The ray of a pixel, by Newton's method. Where the lens has folded back there is none: the pixel's ray without a lens then.
Normalised ray_of_pixel(const simsense_camera& camera, double u, double v);

/// The same by a given number of the fixed-point steps ray <- (pixel - tangential) / radial of Heikkila and Silven (A four-step camera
/// calibration procedure, CVPR 1997): what OpenCV's undistortPoints takes, five of them by default.
Normalised ray_of_pixel_by_steps(const simsense_camera& camera, double u, double v, int steps);

}  // namespace simsense
