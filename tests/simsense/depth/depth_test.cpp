// SPDX-License-Identifier: Apache-2.0
// z = f B / (d + cx_right - cx_left), invalid is 0, and the range keeps its lower end only.
#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "cpu/depth/depth.h"
#include "device/thread_pool.h"
#include "simsense/reference/depth.h"

using namespace simsense;

namespace {
StereoGeometry geometry(double offset) {
  StereoGeometry g;
  g.camera = {400, 400, 31.5, 23.5};
  g.baseline_m = 0.05;
  g.disparity_offset_px = offset;
  return g;
}
constexpr DepthRange everything{0, std::numeric_limits<float>::infinity()};
}  // namespace

TEST(Depth, IsFocalTimesBaselineOverParallax) {
  for (double offset : {0.0, 3.5, -2.25}) {
    std::vector<float> disparity(64 * 48), depth(disparity.size());
    for (size_t i = 0; i < disparity.size(); ++i) disparity[i] = i % 11 == 0 ? -1 : static_cast<float>(i % 997) * 0.125f;
    ks::ThreadPool workers(2);
    depth_from_disparity(geometry(offset), everything, disparity.data(), -1, 64, 48, depth.data(), workers);
    for (size_t i = 0; i < depth.size(); ++i) {
      const double z = reference::depth(geometry(offset), disparity[i]);
      EXPECT_NEAR(depth[i], z, 1e-6 * z) << "disparity " << disparity[i] << " offset " << offset;
      EXPECT_EQ(depth[i] == 0, disparity[i] < 0 || disparity[i] + offset <= 0);
    }
  }
}

TEST(Depth, KeepsMinimumAndDropsMaximum) {
  const std::vector<float> disparity{40, 20, 10, 8, 0, -1};  // 0.5, 1, 2, 2.5 m, infinity, invalid
  std::vector<float> depth(6);
  ks::ThreadPool workers(1);
  depth_from_disparity(geometry(0), {1, 2}, disparity.data(), -1, 6, 1, depth.data(), workers);
  EXPECT_EQ(depth, (std::vector<float>{0, 1, 0, 0, 0, 0}));
}
