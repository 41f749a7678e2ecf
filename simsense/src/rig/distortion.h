// SPDX-License-Identifier: Apache-2.0
// Brown-Conrady distortion of normalised image coordinates, float, for the per-pixel stages.
#pragma once

#include <array>

#include "rig/rig.h"

namespace simsense {

class BrownConrady {
 public:
  explicit BrownConrady(const Distortion& d)
      : k1_(static_cast<float>(d[0])),
        k2_(static_cast<float>(d[1])),
        k3_(static_cast<float>(d[4])),
        p1_(static_cast<float>(d[2])),
        p2_(static_cast<float>(d[3])),
        max_radius2_(fold_radius2(d)) {}

  /// k1, k2, k3, p1, p2, and the squared radius from which on apply() is false.
  [[nodiscard]] std::array<float, 6> coefficients() const { return {k1_, k2_, k3_, p1_, p2_, max_radius2_}; }

  /// false where the polynomial has folded back: such a point is far outside the lens' field, though its image may land inside.
  bool apply(float& x, float& y) const {
    const float r2 = x * x + y * y;
    if (!(r2 < max_radius2_)) return false;
    const float radial = 1 + r2 * (k1_ + r2 * (k2_ + r2 * k3_));
    const float xy2 = 2 * x * y;
    const float distorted_x = x * radial + p1_ * xy2 + p2_ * (r2 + 2 * x * x);
    y = y * radial + p1_ * (r2 + 2 * y * y) + p2_ * xy2;
    x = distorted_x;
    return true;
  }

 private:
  /// First squared radius where d/dr (r + k1 r^3 + k2 r^5 + k3 r^7) is no longer positive; the scan ends at 10 (84 degrees off axis).
  static float fold_radius2(const Distortion& d) {
    for (double r = 0; r < 10; r += 1e-3) {
      const double r2 = r * r;
      if (1 + r2 * (3 * d[0] + r2 * (5 * d[1] + r2 * 7 * d[4])) <= 0) return static_cast<float>(r2);
    }
    return 100;
  }

  float k1_, k2_, k3_, p1_, p2_, max_radius2_;
};

}  // namespace simsense
