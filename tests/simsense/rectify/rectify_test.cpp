// SPDX-License-Identifier: Apache-2.0
// Laws of rectification: a point in space lies on one row of both rectified images, its disparity is f B / z; maps and resampling equal the
// camera model.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "cpu/checks/padding.h"
#include "cpu/rectify/remap.h"
#include "device/error.h"
#include "device/thread_pool.h"
#include "simsense/reference/depth.h"
#include "simsense/reference/rectify.h"
#include "simsense/rig_samples.h"

using namespace simsense;
using namespace simsense_test;

namespace {

std::array<double, 2> project(const simsense_camera& c, const std::array<double, 3>& p) {
  const auto [x, y] = reference::distort(c, p[0] / p[2], p[1] / p[2]);
  return {c.k[0] * x + c.k[2], c.k[4] * y + c.k[5]};
}

std::array<double, 3> moved(const Rigid& r, const std::array<double, 3>& p) {
  std::array<double, 3> out = r.translation;
  for (size_t i = 0; i < 3; ++i)
    for (size_t j = 0; j < 3; ++j) out[i] += r.rotation[3 * i + j] * p[j];
  return out;
}

/// The map's value between its pixels.
std::array<double, 2> look_up(const RemapTable& t, double u, double v) {
  const auto x = static_cast<size_t>(u), y = static_cast<size_t>(v);
  const double fx = u - static_cast<double>(x), fy = v - static_cast<double>(y);
  const auto mix = [&](const std::vector<float>& m) {
    const float* p = m.data() + y * t.width + x;
    return (1 - fy) * ((1 - fx) * p[0] + fx * p[1]) + fy * ((1 - fx) * p[t.width] + fx * p[t.width + 1]);
  };
  return {mix(t.x), mix(t.y)};
}

std::string refusal(const simsense_rig_desc& rig) {
  try {
    check_rig(rig);
    make_rectification(rig);
  } catch (const ks::Error& e) {
    EXPECT_EQ(e.status(), KS_ERROR_INVALID_ARGUMENT);
    return e.what();
  }
  return "";
}

}  // namespace

TEST(Rectification, PutsAPointOnOneRowWithDisparityFocalTimesBaselineOverDepth) {
  const simsense_rig_desc rig = crooked_rig();
  const Rectification r = make_rectification(rig);
  const StereoGeometry& g = r.geometry;
  const Rigid to_right = rigid(rig.left_to_right), to_rectified{g.left_to_rectified, {}};
  EXPECT_NEAR(g.baseline_m, std::hypot(0.05, 0.001, 0.0015), 1e-9);
  EXPECT_NEAR(g.disparity_offset_px, 0, 1e-9);
  int checked = 0;
  for (double x = -0.4; x <= 0.4; x += 0.1)
    for (double y = -0.3; y <= 0.3; y += 0.1)
      for (double z : {0.4, 1.0, 3.0}) {
        const std::array<double, 3> in_left{x * z, y * z, z}, p = moved(to_rectified, in_left);
        const double u = g.camera.fx * p[0] / p[2] + g.camera.cx, v = g.camera.fy * p[1] / p[2] + g.camera.cy;
        const double disparity = g.camera.fx * g.baseline_m / p[2];
        if (u - disparity < 1 || u > 317 || v < 1 || v > 237) continue;
        const auto left = look_up(r.left, u, v), right = look_up(r.right, u - disparity, v);
        const auto seen_left = project(rig.left, in_left), seen_right = project(rig.right, moved(to_right, in_left));
        for (size_t i = 0; i < 2; ++i) {
          EXPECT_NEAR(left[i], seen_left[i], 2e-3);
          EXPECT_NEAR(right[i], seen_right[i], 2e-3);
        }
        ++checked;
      }
  EXPECT_GT(checked, 80);
}

TEST(Rectification, LeftMapEqualsTheCameraModel) {
  const simsense_rig_desc rig = crooked_rig();
  const Rectification r = make_rectification(rig);
  for (uint32_t v = 0; v < 240; v += 17)
    for (uint32_t u = 0; u < 320; u += 13) {
      const auto expected = reference::rectified_to_source(rig.left, r.geometry.left_to_rectified, r.geometry.camera, u, v);
      EXPECT_NEAR(r.left.x[v * 320 + u], expected[0], 1e-3);
      EXPECT_NEAR(r.left.y[v * 320 + u], expected[1], 1e-3);
    }
}

TEST(Rectification, OfAnIdealPairIsTheIdentity) {
  simsense_rig_desc rig = ideal_rig();
  rig.rectified = 0;
  const Rectification r = make_rectification(rig);
  EXPECT_NEAR(r.geometry.camera.fx, 215, 1e-9);
  EXPECT_NEAR(r.geometry.camera.cx, 159.5, 1e-4);
  EXPECT_NEAR(r.geometry.camera.cy, 119.5, 1e-4);
  for (uint32_t v = 0; v < 240; v += 7)
    for (uint32_t u = 0; u < 320; u += 7) {
      EXPECT_NEAR(r.left.x[v * 320 + u], u, 1e-3);
      EXPECT_NEAR(r.right.y[v * 320 + u], v, 1e-3);
    }
}

TEST(Rectification, OfARectifiedPairKeepsItsCalibration) {
  simsense_rig_desc rig = ideal_rig();
  rig.right.k[2] += 4.25;
  const Rectification r = make_rectification(rig);
  EXPECT_TRUE(r.is_identity());
  EXPECT_EQ(r.geometry.camera.fx, rig.left.k[0]);
  EXPECT_EQ(r.geometry.camera.cx, rig.left.k[2]);
  EXPECT_EQ(r.geometry.baseline_m, 0.05);
  EXPECT_EQ(r.geometry.disparity_offset_px, 4.25);
}

TEST(Remap, EqualsTheReference) {
  const simsense_rig_desc rig = crooked_rig();
  const Rectification r = make_rectification(rig);
  std::vector<uint8_t> image(320 * 240), flipped(image.size()), out(image.size()), again(image.size());
  for (size_t i = 0; i < image.size(); ++i) image[i] = static_cast<uint8_t>((i * 2654435761u) >> 24);
  for (size_t y = 0; y < 240; ++y) std::memcpy(flipped.data() + (239 - y) * 320, image.data() + y * 320, 320);
  ks::ThreadPool two(2), one(1);
  remap(r.right, {image.data(), 320}, out.data(), two);
  remap(r.right, {flipped.data() + 239 * 320, -320}, again.data(), one);
  EXPECT_EQ(out, again) << "rows from bottom to top, another number of workers";
  int padding = 0;
  for (size_t i = 0; i < out.size(); ++i) {
    EXPECT_NEAR(out[i], reference::bilinear(image.data(), 320, 240, r.right.x[i], r.right.y[i]), 0.5 + 1e-3);
    const float x = r.right.x[i], y = r.right.y[i];
    if (x > -1 && y > -1 && x < 320 && y < 240) continue;
    EXPECT_EQ(out[i], 0);
    ++padding;
  }
  EXPECT_GT(padding, 100) << "this rig must leave padding";
}

TEST(Remap, TakesSixteenBitsAsItTakesEight) {
  const Rectification r = make_rectification(crooked_rig());
  std::vector<uint8_t> image(320 * 240), out(image.size());
  for (size_t i = 0; i < image.size(); ++i) image[i] = static_cast<uint8_t>((i * 2654435761u) >> 24);
  std::vector<uint16_t> wide(image.begin(), image.end()), wide_out(image.size());
  ks::ThreadPool workers(2);
  for (const auto resample : {remap, remap_nearest}) {
    resample(r.left, {image.data(), 320}, out.data(), workers);
    resample(r.left, {reinterpret_cast<const uint8_t*>(wide.data()), 320, 2}, wide_out.data(), workers);
    EXPECT_TRUE(std::equal(out.begin(), out.end(), wide_out.begin()));
  }
}

TEST(Remap, KeepsWholePixelsAndFadesOutOverTheBorder) {
  const std::vector<uint8_t> image{10, 20, 30, 40};
  RemapTable t{2, 2, {0, 1, -0.5f, 1.5f}, {0, 1, 0, 1}};
  std::vector<uint8_t> out(4);
  ks::ThreadPool workers(1);
  remap(t, {image.data(), 2}, out.data(), workers);
  EXPECT_EQ(out, (std::vector<uint8_t>{10, 40, 5, 20}));
  std::vector<float> disparity(4, 7);
  invalidate_outside(t, disparity.data(), -1, workers);
  EXPECT_EQ(disparity, (std::vector<float>{7, 7, -1, -1}));
}

TEST(Rig, EachFaultIsRefusedWithItsNumber) {
  struct Fault {
    const char* says;
    void (*make)(simsense_rig_desc&);
  };
  const Fault faults[] = {
      {"31x240", [](simsense_rig_desc& r) { r.left.width = r.right.width = 31; }},
      {"right is 321x240", [](simsense_rig_desc& r) { r.right.width = 321; }},
      {"fx = -215", [](simsense_rig_desc& r) { r.left.k[0] = -215; }},
      {"k[2] = nan", [](simsense_rig_desc& r) { r.right.k[2] = NAN; }},
      {"without skew", [](simsense_rig_desc& r) { r.right.k[1] = 0.5; }},
      {"distortion[3] is inf", [](simsense_rig_desc& r) { r.right.lens.distortion[3] = INFINITY; }},
      {"translation 0.05 m", [](simsense_rig_desc& r) { r.left_to_right[3] = 0.05; }},
      {"last row is [0 0 0 2]", [](simsense_rig_desc& r) { r.left_to_right[15] = 2; }},
      {"not a rotation", [](simsense_rig_desc& r) { r.left_to_right[0] = 1.1; }},
      {"determinant -1", [](simsense_rig_desc& r) { r.left_to_right[10] = -1; }},
      {"batch_count is 0", [](simsense_rig_desc& r) { r.batch_count = 0; }},
      {"rotates by 0.05 rad", [](simsense_rig_desc& r) { set_pose(r.left_to_right, 0, 0.05, 0, -0.05, 0, 0); }},
      {"moves 0.01, 0 m", [](simsense_rig_desc& r) { r.left_to_right[7] = 0.01; }},
      {"right 219, 215", [](simsense_rig_desc& r) { r.right.k[0] = 219; }},
      {"119.5 left and 122.5 right", [](simsense_rig_desc& r) { r.right.k[5] += 3; }},
      {"right.lens.distortion[0] = -0.1", [](simsense_rig_desc& r) { r.right.lens.distortion[0] = -0.1; }},
      {"rgb camera is 640x0", [](simsense_rig_desc& r) { r.rgb.width = 640; }},
      {"left_to_rgb[3] = nan", [](simsense_rig_desc& r) { r.rgb = r.left, r.left_to_rgb[3] = NAN; }},
      {"side by side", [](simsense_rig_desc& r) { r.rectified = 0, r.left_to_right[3] = -0.001, r.left_to_right[7] = -0.05; }},
  };
  for (const Fault& fault : faults) {
    simsense_rig_desc rig = ideal_rig();
    fault.make(rig);
    EXPECT_NE(refusal(rig).find(fault.says), std::string::npos) << "wanted '" << fault.says << "', got '" << refusal(rig) << "'";
  }
  EXPECT_EQ(refusal(ideal_rig()), "");
  EXPECT_EQ(refusal(crooked_rig()), "");
}
