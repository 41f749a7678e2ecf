// SPDX-License-Identifier: Apache-2.0
// Laws of registration: closed-form shifts of a plane, the nearest surface wins, what was not measured lands nowhere, lenses are honoured.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "cpu/registration/registration.h"
#include "device/thread_pool.h"
#include "simsense/reference/camera.h"
#include "simsense/rig_samples.h"

using namespace simsense;
using namespace simsense_test;

namespace {

constexpr DepthRange everything{0, std::numeric_limits<float>::infinity()};
constexpr uint32_t width = 160, height = 120;

StereoGeometry straight() {
  StereoGeometry g;
  g.camera = {100, 100, 79.5, 59.5};
  g.baseline_m = 0.05;
  return g;
}

Rigid pose(double rx, double ry, double rz, double tx, double ty, double tz) {
  double m[16];
  set_pose(m, rx, ry, rz, tx, ty, tz);
  return rigid(m);
}

std::vector<float> registered(const StereoGeometry& g, const simsense_camera& rgb, const Rigid& to_rgb, const std::vector<float>& depth,
                              const DepthRange& range = everything, uint32_t splat_size = 1, unsigned workers = 2) {
  ks::ThreadPool pool(workers);
  std::vector<float> out(size_t{rgb.width} * rgb.height, -7);
  const RgbProjection projection(g, rgb, to_rgb);
  Registration(projection, width, height).apply(depth.data(), range, {.size = splat_size}, out.data(), pool);
  return out;
}

/// The same by OpenCV's projection, pixel by pixel. An even splat_size reaches one further left and up; the nearest point wins.
std::vector<float> registered_by_opencv(const StereoGeometry& g, const simsense_camera& rgb, const Rigid& to_rgb,
                                        const std::vector<float>& depth, const DepthRange& range, uint32_t splat_size) {
  constexpr float nothing = std::numeric_limits<float>::infinity();
  std::vector<float> nearest(size_t{rgb.width} * rgb.height, nothing);
  const cv::Matx33d to_left = cv::Matx33d(g.left_to_rectified.data()).t();
  for (uint32_t v = 0; v < height; ++v)
    for (uint32_t u = 0; u < width; ++u) {
      const double z = depth[v * width + u];
      const cv::Vec3d rectified(z * (u - g.camera.cx) / g.camera.fx, z * (v - g.camera.cy) / g.camera.fy, z);
      const cv::Vec3d in_rgb = reference::moved(to_rgb, to_left * rectified);
      if (z <= 0 || in_rgb[2] <= 0) continue;
      const cv::Point2d seen = reference::project(rgb, in_rgb);
      const double left = std::floor(seen.x + 0.5) - splat_size / 2, top = std::floor(seen.y + 0.5) - splat_size / 2;
      for (uint32_t k = 0; k < splat_size * splat_size; ++k) {
        const double x = left + k % splat_size, y = top + k / splat_size;
        if (x < 0 || y < 0 || x >= rgb.width || y >= rgb.height) continue;
        float& cell = nearest[static_cast<size_t>(y) * rgb.width + static_cast<size_t>(x)];
        cell = std::min(cell, static_cast<float>(in_rgb[2]));
      }
    }
  for (float& z : nearest) z = z == nothing ? 0 : range.keep(z);
  return nearest;
}

std::vector<float> bumpy() {
  std::vector<float> depth(width * height);
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x)
      depth[y * width + x] =
          (x / 20 + y / 20) % 3 == 0 ? 0 : 0.8f + 0.3f * std::sin(0.1f * static_cast<float>(x)) + 0.002f * static_cast<float>(y);
  return depth;
}

size_t landed(const std::vector<float>& image) {
  return static_cast<size_t>(std::count_if(image.begin(), image.end(), [](float z) { return z > 0; }));
}

}  // namespace

TEST(Registration, ShiftsAPlaneByFocalTimesOffsetOverDepth) {
  const std::vector<float> depth(width * height, 2.0f);
  // 40 mm to the right, 20 mm down: 2 pixels to the left and 1 up at f = 100, z = 2 m.
  const auto out = registered(straight(), camera(width, height, 100), pose(0, 0, 0, -0.04, -0.02, 0), depth);
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x) EXPECT_EQ(out[y * width + x], x < width - 2 && y < height - 1 ? 2.0f : 0.0f) << x << "," << y;
}

TEST(Registration, EqualsTheReferenceThroughRotationsAndLens) {
  StereoGeometry g = straight();
  g.left_to_rectified = pose(0.01, 0.03, -0.02, 0, 0, 0).rotation;
  simsense_camera rgb = camera(200, 130, 120);
  const double lens[5] = {0.1, -0.2, 1e-3, -2e-3, 0.05};
  std::copy(lens, lens + 5, rgb.lens.distortion);
  const Rigid to_rgb = pose(-0.02, 0.04, 0.01, 0.015, 0.002, -0.004);
  const auto depth = bumpy();
  for (const uint32_t splat_size : {1u, 2u, 3u, 6u}) {
    const auto fast = registered(g, rgb, to_rgb, depth, {0.2f, 1.2f}, splat_size);
    const auto slow = registered_by_opencv(g, rgb, to_rgb, depth, {0.2f, 1.2f}, splat_size);
    size_t different = 0;  // a projection within float rounding of half a pixel may land on either side
    for (size_t i = 0; i < fast.size(); ++i) different += std::abs(fast[i] - slow[i]) > 1e-5;
    EXPECT_LE(different, fast.size() / 1000);
    EXPECT_GT(landed(fast), fast.size() / 4);
  }
}

TEST(Registration, NearestSurfaceWins) {
  // A near strip in front of a far wall; the RGB camera 100 mm to the right sees the strip shifted by 20 px and the wall by 5.
  std::vector<float> depth(width * height, 2.0f);
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 80; x < 90; ++x) depth[y * width + x] = 0.5f;
  const auto out = registered(straight(), camera(width, height, 100), pose(0, 0, 0, -0.1, 0, 0), depth);
  const float* row = out.data() + 60 * width;
  for (uint32_t x = 0; x < width - 5; ++x) {
    const bool strip = x >= 60 && x < 70, shadow = x >= 75 && x < 85;  // what the strip hid from the left camera
    EXPECT_EQ(row[x], strip ? 0.5f : shadow ? 0.0f : 2.0f) << x;
  }
}

TEST(Registration, UnmeasuredPixelsLandNowhere) {
  const auto out =
      registered(straight(), camera(width, height, 100), pose(0, 0, 0, 0.01, 0, 0.3), std::vector<float>(width * height, 0.0f));
  EXPECT_EQ(landed(out), 0u);  // with the translation alone they would all land at z = 0.3 m
}

TEST(Registration, RangeHoldsInTheRgbFrame) {
  const std::vector<float> depth(width * height, 1.0f);
  const Rigid half_metre_back = pose(0, 0, 0, 0, 0, 0.5);  // the RGB camera sees the plane at 1.5 m
  EXPECT_EQ(landed(registered(straight(), camera(width, height, 100), half_metre_back, depth, {0.2f, 1.4f})), 0u);
  EXPECT_GT(landed(registered(straight(), camera(width, height, 100), half_metre_back, depth, {1.4f, 2.0f})), 1000u);
}

TEST(Registration, DilationCoversTwoByTwoUpAndLeft) {
  std::vector<float> depth(width * height, 0.0f);
  depth[50 * width + 60] = 1;
  depth[50 * width + 61] = 2;
  depth[0] = 3;
  const auto out = registered(straight(), camera(width, height, 100), Rigid{}, depth, everything, 2);
  std::vector<float> expected(depth.size(), 0.0f);
  for (uint32_t y : {49u, 50u}) {
    expected[y * width + 59] = expected[y * width + 60] = 1;  // the nearer point covers the farther one's left half
    expected[y * width + 61] = 2;
  }
  expected[0] = 3;
  EXPECT_EQ(out, expected);
}

TEST(Registration, SplatsOfPointsBeyondTheBorderReachIn) {
  // Points land on every second pixel, at odd columns and rows; what covers the last column and row lands one beyond them.
  const std::vector<float> depth(width * height, 1.0f);
  simsense_rig_desc rig = ideal_rig(width, height, 100);
  rig.rgb = camera(301, 221, 200);
  ks::ThreadPool pool(2);
  std::vector<float> out(size_t{301} * 221);
  const auto land = [&] {
    const RgbProjection projection(rig, straight());
    Registration(projection, width, height).apply(depth.data(), everything, {.size = 2}, out.data(), pool);
  };
  land();
  EXPECT_EQ(landed(out), out.size());
  rig.faults = SIMSENSE_FAULT_SPLAT_CLIPPED;
  land();
  EXPECT_EQ(landed(out), size_t{300} * 220);
}

TEST(Registration, DoesNotDependOnTheNumberOfWorkers) {
  const Rigid to_rgb = pose(0.1, 0.3, 0.05, 0.2, 0.1, 0.4);
  const simsense_camera rgb = camera(40, 30, 12);  // many points per pixel: the workers fight for each
  const auto one = registered(straight(), rgb, to_rgb, bumpy(), everything, true, 1);
  for (unsigned workers : {2u, 5u}) EXPECT_EQ(one, registered(straight(), rgb, to_rgb, bumpy(), everything, true, workers));
}

TEST(Registration, PointsBeyondTheFoldOfTheLensAreNotSeen) {
  simsense_camera rgb = camera(width, height, 100);
  rgb.lens.distortion[0] = -0.3;  // r - 0.3 r^3 turns back at r = 1.05 and is 0 again at r = 1.83
  const std::vector<float> depth(width * height, 0.5f);
  const auto out = registered(straight(), rgb, pose(0, 0, 0, 1, 0, 0), depth);  // every point lies at r = 1.2 to 2.8
  EXPECT_EQ(landed(out), 0u);
}
