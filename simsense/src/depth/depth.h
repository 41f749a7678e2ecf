// Disparity to depth: z = fx * baseline / (disparity + cx_right - cx_left), 0 = invalid.
// Thread rule: pure functions; the result does not depend on the number of workers.
#pragma once

#include "rectify/rectification.h"

namespace ks {
class ThreadPool;
}

namespace simsense {

/// Keep min_m <= z < max_m, else 0. Applied to each output in that output's own camera frame.
struct DepthRange {
  float min_m = 0, max_m = 0;
  [[nodiscard]] float keep(float z) const { return z >= min_m && z < max_m ? z : 0; }
};

/// disparity: packed [height][width] pixels, `invalid` and below are invalid. depth: packed [height][width] metres; may be the same memory.
void depth_from_disparity(const StereoGeometry& geometry, const DepthRange& range, const float* disparity, float invalid, uint32_t width,
                          uint32_t height, float* depth, ks::ThreadPool& workers);

}  // namespace simsense
