// SPDX-License-Identifier: Apache-2.0
// The ray of each pixel of the points' camera, at z = 1. Thread rule: immutable.
#pragma once

#include <vector>

#include "rig/rig.h"

namespace simsense {

class PixelRays {
 public:
  /// For a pinhole without distortion.
  PixelRays(const Pinhole& camera, uint32_t width, uint32_t height);
  /// For a camera with its lens: each pixel's ray is undistorted once.
  explicit PixelRays(const simsense_camera& camera);

  /// Ray slopes of each column and row; of each pixel, [height][width], if is_per_pixel().
  [[nodiscard]] const std::vector<float>& x() const { return x_; }
  [[nodiscard]] const std::vector<float>& y() const { return y_; }
  [[nodiscard]] bool is_per_pixel() const { return per_pixel_; }

 private:
  std::vector<float> x_, y_;
  bool per_pixel_ = false;  // else one row and one column
};

}  // namespace simsense
