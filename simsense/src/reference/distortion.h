// SPDX-License-Identifier: Apache-2.0
// Brown-Conrady distortion, as OpenCV's documentation of the pinhole camera gives it: radial k1, k2, k3 and tangential p1, p2 on normalised
// coordinates.
#pragma once

#include <array>

#include "simsense/simsense.h"

namespace simsense::reference {

std::array<double, 2> distort(const simsense_camera& camera, double x, double y);

}  // namespace simsense::reference
