// SPDX-License-Identifier: Apache-2.0
// Disparity to depth: z = fx * baseline / (disparity + cx_right - cx_left), 0 = invalid. Plain values.
#pragma once

namespace simsense {

/// Keeps depths min_m <= z < max_m, and sets others to 0. It is applied to each output in its own camera's frame.
struct DepthRange {
  float min_m = 0, max_m = 0;
  [[nodiscard]] float keep(float z) const { return z >= min_m && z < max_m ? z : 0; }
};

}  // namespace simsense
