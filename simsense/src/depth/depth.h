// SPDX-License-Identifier: Apache-2.0
// Disparity to depth: z = fx * baseline / (disparity + cx_right - cx_left), 0 = invalid. Plain values.
#pragma once

namespace simsense {

/// Keep min_m <= z < max_m, else 0. Applied to each output in that output's own camera frame.
struct DepthRange {
  float min_m = 0, max_m = 0;
  [[nodiscard]] float keep(float z) const { return z >= min_m && z < max_m ? z : 0; }
};

}  // namespace simsense
