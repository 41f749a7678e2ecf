// SPDX-License-Identifier: Apache-2.0
// Depth of a disparity, and points of a depth.
#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "cpu/depth/depth.h"
#include "device/thread_pool.h"
#include "simsense/reference/camera.h"
#include "simsense/rig_samples.h"

using namespace simsense;
using namespace simsense_test;

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
      const bool is_nothing = disparity[i] < 0 || disparity[i] + offset <= 0;
      const double z = is_nothing ? 0 : 400 * 0.05 / (disparity[i] + offset);
      EXPECT_NEAR(depth[i], z, 1e-6 * z) << "disparity " << disparity[i] << " offset " << offset;
      EXPECT_EQ(depth[i] == 0, is_nothing);
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

namespace {

std::vector<float> points_of(const PixelRays& rays, const std::vector<float>& depth, uint32_t width) {
  std::vector<float> points(3 * depth.size(), -7);
  ks::ThreadPool workers(2);
  const auto height = static_cast<uint32_t>(depth.size() / width);
  make_points(rays, depth.data(), width, height, {reinterpret_cast<std::byte*>(points.data()), ptrdiff_t{12} * width, 12}, 4, workers);
  return points;
}

void expect_projection(const simsense_camera& c, const std::vector<float>& depth, const std::vector<float>& points) {
  for (uint32_t y = 0; y < c.height; ++y)
    for (uint32_t x = 0; x < c.width; ++x) {
      const size_t i = size_t{y} * c.width + x;
      const float* p = points.data() + 3 * i;
      EXPECT_EQ(p[2], depth[i]);
      if (depth[i] == 0) {
        EXPECT_EQ(p[0], 0);
        EXPECT_EQ(p[1], 0);
        continue;
      }
      const cv::Point2d seen = reference::project(c, {p[0], p[1], p[2]});
      EXPECT_NEAR(seen.x, x, 1e-3);
      EXPECT_NEAR(seen.y, y, 1e-3);
    }
}

std::vector<float> sample_depth(const simsense_camera& c) {
  std::vector<float> depth(size_t{c.width} * c.height);
  for (size_t i = 0; i < depth.size(); ++i) depth[i] = i % 5 == 0 ? 0 : 0.3f + 0.01f * static_cast<float>(i % 101);
  return depth;
}

}  // namespace

TEST(Points, ProjectBackToTheirPixels) {
  simsense_camera c = camera(64, 48, 50);
  const auto depth = sample_depth(c);
  expect_projection(c, depth, points_of(PixelRays(c), depth, 64));
  expect_projection(c, depth, points_of(PixelRays(pinhole(c), 64, 48), depth, 64));
  const double lens[8] = {-0.15, 0.05, 1e-3, -5e-4, 0.01, 0.05, -0.02, 0.01};
  for (int i = 0; i < 8; ++i) c.lens.distortion[i] = lens[i];
  expect_projection(c, depth, points_of(PixelRays(c), depth, 64));
}

TEST(Points, FollowAnyStrides) {
  const simsense_camera c = camera(32, 32, 40);
  const auto depth = sample_depth(c);
  const auto packed = points_of(PixelRays(c), depth, 32);
  std::vector<float> planar(packed.size());  // x plane, y plane, z plane, rows from bottom to top
  ks::ThreadPool workers(2);
  make_points(PixelRays(c), depth.data(), 32, 32, {reinterpret_cast<std::byte*>(planar.data() + 31 * 32), -32 * 4, 4}, 32 * 32 * 4,
              workers);
  for (uint32_t y = 0; y < 32; ++y)
    for (uint32_t x = 0; x < 32; ++x)
      for (uint32_t k = 0; k < 3; ++k) EXPECT_EQ(planar[k * 1024 + (31 - y) * 32 + x], packed[(y * 32 + x) * 3 + k]);
}
