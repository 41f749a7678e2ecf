// SPDX-License-Identifier: Apache-2.0
// Rational Brown-Conrady distortion of normalised image coordinates, float, for the per-pixel stages.
#pragma once

#include <array>

#include "rig/undistort.h"

namespace simsense {

class BrownConrady {
 public:
  explicit BrownConrady(const Distortion& d)
      : k1_(static_cast<float>(d[0])),
        k2_(static_cast<float>(d[1])),
        k3_(static_cast<float>(d[4])),
        k4_(static_cast<float>(d[5])),
        k5_(static_cast<float>(d[6])),
        k6_(static_cast<float>(d[7])),
        p1_(static_cast<float>(d[2])),
        p2_(static_cast<float>(d[3])),
        max_radius2_(static_cast<float>(fold_radius2(d))) {}

  /// k1, k2, k3, k4, k5, k6, p1, p2, and the squared radius from which on apply() is false.
  [[nodiscard]] std::array<float, 9> coefficients() const { return {k1_, k2_, k3_, k4_, k5_, k6_, p1_, p2_, max_radius2_}; }

  /// false where the lens has folded back: such a point is far outside the lens' field, though its image may land inside.
  bool apply(float& x, float& y) const {
    const float r2 = x * x + y * y;
    if (!(r2 < max_radius2_)) return false;
    const float radial = (1 + r2 * (k1_ + r2 * (k2_ + r2 * k3_))) / (1 + r2 * (k4_ + r2 * (k5_ + r2 * k6_)));
    const float xy2 = 2 * x * y;
    const float distorted_x = x * radial + p1_ * xy2 + p2_ * (r2 + 2 * x * x);
    y = y * radial + p1_ * (r2 + 2 * y * y) + p2_ * xy2;
    x = distorted_x;
    return true;
  }

 private:
  float k1_, k2_, k3_, k4_, k5_, k6_, p1_, p2_, max_radius2_;
};

}  // namespace simsense
