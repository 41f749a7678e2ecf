// SPDX-License-Identifier: Apache-2.0
// Fresnel's law for tests of glass.
#pragma once

#include <cmath>

namespace laws {

/// Reflectance of air to index n, unpolarised (Hecht, Optics, 4.6). angle: of the ray in air, radians.
inline double reflectance(double angle, double n) {
  const double c = std::cos(angle), ct = std::sqrt(1 - std::pow(std::sin(angle) / n, 2));
  const double s = (c - n * ct) / (c + n * ct), p = (n * c - ct) / (n * c + ct);
  return (s * s + p * p) / 2;
}

}  // namespace laws
