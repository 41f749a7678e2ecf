// SPDX-License-Identifier: Apache-2.0
// What a lens makes of a ray, and from a pixel back to the ray that its lens bent there: Brown-Conrady distortion (Brown, Decentering
// distortion of lenses, Photogrammetric Engineering 32(3), 1966) and fisheye lenses (Kannala and Brandt, A generic camera model and
// calibration method for conventional, wide-angle, and fish-eye lenses, 2006), double precision. Thread rule: pure functions.
#pragma once

#include "rig/rig.h"

namespace simsense {

/// Normalised coordinates, x / z and y / z of a ray.
using Normalised = std::array<double, 2>;

/// A ray as the lens bends it.
Normalised distorted(const ks_lens& lens, const Normalised& ray);

/// Squared radius x^2 + y^2 of the first rays that the radial distortion no longer bends farther out than their neighbours within, or
/// where its denominator is 0: from there on the lens shows the scene a second time, folded. Where it does not fold: 100 (84 degrees off
/// axis), of a fisheye lens 1e8.
double fold_radius2(const ks_lens& lens);

/// The ray of a pixel, by Newton's method. Where the lens has folded back there is none: the pixel's ray without a lens then.
Normalised ray_of_pixel(const simsense_camera& camera, double u, double v);

/// The same by a given number of the fixed-point steps ray <- (pixel - tangential) / radial of Heikkila and Silven (A four-step camera
/// calibration procedure, CVPR 1997): what OpenCV's undistortPoints takes, five of them by default. Of a fisheye lens as ray_of_pixel().
Normalised ray_of_pixel_by_steps(const simsense_camera& camera, double u, double v, int steps);

}  // namespace simsense
