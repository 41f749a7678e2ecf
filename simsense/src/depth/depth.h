// SPDX-License-Identifier: Apache-2.0
// Disparity to depth: z = fx * baseline / (disparity + cx_right - cx_left), 0 = invalid.
#pragma once

#include <vector>

#include "rig/rig.h"

namespace simsense {

/// Keeps depths min_m <= z < max_m, and sets others to 0. It is applied to each output in its own camera's frame.
struct DepthRange {
  float min_m = 0, max_m = 0;
  [[nodiscard]] float keep(float z) const { return z >= min_m && z < max_m ? z : 0; }
};

/// The ray of each pixel of the points' camera, at z = 1. Thread rule: immutable.
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
