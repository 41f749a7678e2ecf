// SPDX-License-Identifier: Apache-2.0
#include "cpu/depth/depth.h"

#include "device/thread_pool.h"

namespace simsense {

void depth_from_disparity(const StereoGeometry& geometry, const DepthRange& range, const float* disparity, float invalid, uint32_t width,
                          uint32_t height, float* depth, ks::ThreadPool& workers) {
  const float focal_baseline = static_cast<float>(geometry.camera.fx * geometry.baseline_m);  // pixels * metres
  const float offset = static_cast<float>(geometry.disparity_offset_px);
  workers.parallel_for(height, [&](size_t y) {
    for (size_t i = y * width; i < (y + 1) * width; ++i) {
      const float parallax = disparity[i] + offset;
      const bool measured = disparity[i] > invalid && parallax > 0;
      depth[i] = measured ? range.keep(focal_baseline / parallax) : 0;
    }
  });
}

}  // namespace simsense
