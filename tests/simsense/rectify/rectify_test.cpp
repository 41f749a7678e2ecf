// SPDX-License-Identifier: Apache-2.0
// Rectification against the camera model and against OpenCV.
#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "cpu/checks/checks.h"
#include "cpu/rectify/remap.h"
#include "device/error.h"
#include "device/thread_pool.h"
#include "ks/lens.hpp"
#include "rectify/rectification.h"
#include "rectify/stereo_rectify.h"
#include "rig/rig.h"
#include "simsense/reference/camera.h"
#include "simsense/rig_samples.h"

using namespace simsense;
using namespace simsense_test;

namespace {

/// Bilinear value at (x, y) of a packed image; what lies outside is 0.
template <class T>
double bilinear(const std::vector<T>& image, uint32_t width, double x, double y) {
  double sum = 0;
  for (int dy = 0; dy < 2; ++dy)
    for (int dx = 0; dx < 2; ++dx) {
      const double column = std::floor(x) + dx, row = std::floor(y) + dy;
      if (column < 0 || row < 0 || column >= width || row >= static_cast<double>(image.size() / width)) continue;
      sum += (1 - std::abs(x - column)) * (1 - std::abs(y - row)) * image[static_cast<size_t>(row) * width + static_cast<size_t>(column)];
    }
  return sum;
}

/// The map's value between its pixels.
cv::Point2d look_up(const RemapTable& t, double u, double v) { return {bilinear(t.x, t.width, u, v), bilinear(t.y, t.width, u, v)}; }

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
        const cv::Vec3d in_left{x * z, y * z, z}, p = reference::moved(to_rectified, in_left);
        const double u = g.camera.fx * p[0] / p[2] + g.camera.cx, v = g.camera.fy * p[1] / p[2] + g.camera.cy;
        const double disparity = g.camera.fx * g.baseline_m / p[2];
        if (u - disparity < 1 || u > 317 || v < 1 || v > 237) continue;
        const cv::Point2d left = look_up(r.left, u, v) - reference::project(rig.left, in_left);
        const cv::Point2d right = look_up(r.right, u - disparity, v) - reference::project(rig.right, reference::moved(to_right, in_left));
        for (const double error : {left.x, left.y, right.x, right.y}) EXPECT_NEAR(error, 0, 2e-3);
        ++checked;
      }
  EXPECT_GT(checked, 80);
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
    EXPECT_NEAR(out[i], bilinear(image, 320, r.right.x[i], r.right.y[i]), 0.5 + 1e-3);
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
  const Fault<simsense_rig_desc> faults[] = {
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
      {"faults is 0x80", [](simsense_rig_desc& r) { r.faults = 0x80; }},
      {"side by side", [](simsense_rig_desc& r) { r.rectified = 0, r.left_to_right[3] = -0.001, r.left_to_right[7] = -0.05; }},
  };
  for (const auto& fault : faults) {
    simsense_rig_desc rig = ideal_rig();
    fault.make(rig);
    EXPECT_NE(refusal(rig).find(fault.says), std::string::npos) << "wanted '" << fault.says << "', got '" << refusal(rig) << "'";
  }
  EXPECT_EQ(refusal(ideal_rig()), "");
  EXPECT_EQ(refusal(crooked_rig()), "");
}

namespace {

cv::Mat matrix(const double* values, int rows, int columns) { return cv::Mat(rows, columns, CV_64F, const_cast<double*>(values)).clone(); }

/// Sensors of all shapes, lenses as strong as those of a wide-angle camera, rotations up to 8 degrees.
class Rigs {
 public:
  simsense_rig_desc next() {
    simsense_rig_desc rig = simsense_rig_desc_init();
    const auto width = static_cast<uint32_t>(between(64, 400)), height = static_cast<uint32_t>(between(64, 300));
    const double focal = between(0.6, 2) * width;
    rig.left = simsense_test::camera(width, height, focal);
    rig.right = simsense_test::camera(width, height, focal * between(0.98, 1.02));
    rig.right.k[4] *= between(0.99, 1.01);
    rig.left.k[2] += between(-20, 20);
    rig.right.k[5] += between(-20, 20);
    const bool bent = count_ % 4 != 0, turned = count_ % 5 != 0, rational = count_ % 3 == 0;
    for (simsense_camera* camera : {&rig.left, &rig.right}) {
      const double most[8] = {0.2, 0.05, 2e-3, 2e-3, 0.01, 0.2, 0.05, 0.01};
      for (int i = 0; i < (rational ? 8 : 5) && bent; ++i) camera->lens.distortion[i] = between(-most[i], most[i]);
    }
    const auto angle = [&] { return turned ? between(-0.08, 0.08) : 0; };
    simsense_test::set_pose(rig.left_to_right, angle(), angle(), angle(), -between(0.02, 0.3), between(-0.01, 0.01), between(-0.01, 0.01));
    ++count_;
    return rig;
  }

 private:
  double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  std::mt19937 random_{1};
  int count_ = 0;
};

struct Expected {
  cv::Mat r1, r2, p1, p2, q;

  Expected(const simsense_rig_desc& rig, bool shrink) {
    const Rigid pose = rigid(rig.left_to_right);
    const cv::Size size(static_cast<int>(rig.left.width), static_cast<int>(rig.left.height));
    cv::stereoRectify(matrix(rig.left.k, 3, 3), matrix(rig.left.lens.distortion, 1, 8), matrix(rig.right.k, 3, 3),
                      matrix(rig.right.lens.distortion, 1, 8), size, matrix(pose.rotation.data(), 3, 3),
                      matrix(pose.translation.data(), 3, 1), r1, r2, p1, p2, q, cv::CALIB_ZERO_DISPARITY, shrink ? 1 : -1);
  }
};

void expect_map(const RemapTable& map, const simsense_camera& camera, const cv::Mat& rotation, const cv::Mat& projection) {
  cv::Mat x, y;
  cv::initUndistortRectifyMap(matrix(camera.k, 3, 3), matrix(camera.lens.distortion, 1, 8), rotation, projection,
                              cv::Size(static_cast<int>(camera.width), static_cast<int>(camera.height)), CV_32FC1, x, y);
  for (size_t i = 0; i < map.x.size(); ++i) {
    if (map.x[i] == -2 && map.y[i] == -2) continue;  // beyond the fold, which OpenCV does not look for
    // one unit in the last place of a float
    ASSERT_NEAR(map.x[i], x.ptr<float>()[i], 1.2e-7 * (1 + std::abs(map.x[i]))) << "pixel " << i;
    ASSERT_NEAR(map.y[i], y.ptr<float>()[i], 1.2e-7 * (1 + std::abs(map.y[i]))) << "pixel " << i;
  }
}

}  // namespace

TEST(OpenCv, RectifiesTheSamePairTheSameWay) {
  Rigs rigs;
  for (int n = 0; n < 400; ++n) {
    const simsense_rig_desc rig = rigs.next();
    for (const bool shrink : {false, true}) {
      const Expected expected(rig, shrink);
      const RectifiedPair pair = rectify_pair(rig.left, rig.right, rigid(rig.left_to_right), shrink);
      ASSERT_TRUE(pair.is_horizontal);
      for (int i = 0; i < 9; ++i) {
        ASSERT_NEAR(pair.left[static_cast<size_t>(i)], expected.r1.at<double>(i / 3, i % 3), 1e-12) << "rig " << n;
        ASSERT_NEAR(pair.right[static_cast<size_t>(i)], expected.r2.at<double>(i / 3, i % 3), 1e-12) << "rig " << n;
      }
      const double focal = expected.p1.at<double>(0, 0);
      ASSERT_NEAR(pair.camera.fx, focal, 1e-9 * std::abs(focal)) << "rig " << n << " shrink " << shrink;
      ASSERT_EQ(pair.camera.fx, pair.camera.fy);
      ASSERT_NEAR(pair.camera.cx, expected.p1.at<double>(0, 2), 1e-6) << "rig " << n;
      ASSERT_NEAR(pair.camera.cy, expected.p1.at<double>(1, 2), 1e-6) << "rig " << n;
      ASSERT_NEAR(pair.baseline_m, 1 / expected.q.at<double>(3, 2), 1e-12) << "rig " << n;
    }
  }
}

TEST(OpenCv, MapsTheSamePixels) {
  Rigs rigs;
  for (int n = 0; n < 40; ++n) {
    simsense_rig_desc rig = rigs.next();
    if (n % 2) rig.faults = SIMSENSE_FAULT_RECTIFIED_SHRUNK;
    const Expected expected(rig, n % 2 != 0);
    if (!(expected.p1.at<double>(0, 0) > 0)) continue;  // a lens that folds within the image: neither can shrink it
    const Rectification r = make_rectification(rig);
    expect_map(r.left, rig.left, expected.r1, expected.p1);
    expect_map(r.right, rig.right, expected.r2, expected.p2);
  }
}

TEST(OpenCv, MapsTheSamePixelsWithinTheFoldAndNoneBeyond) {
  // (1 - 0.3 r^2) / (1 + 0.3 r^2) times r stops growing where 0.09 r^4 + 1.2 r^2 = 1
  const double fold2 = (-1.2 + std::sqrt(1.2 * 1.2 + 4 * 0.09)) / (2 * 0.09);
  simsense_rig_desc rig = simsense_test::ideal_rig(320, 240, 120);
  rig.rectified = 0;
  for (simsense_camera* camera : {&rig.left, &rig.right}) camera->lens.distortion[0] = -0.3, camera->lens.distortion[5] = 0.3;
  const Expected expected(rig, false);
  const Rectification r = make_rectification(rig);
  expect_map(r.left, rig.left, expected.r1, expected.p1);
  int within = 0, beyond = 0;
  for (uint32_t v = 0; v < 240; ++v)
    for (uint32_t u = 0; u < 320; ++u) {
      const Pinhole& k = r.geometry.camera;
      const double radius = std::hypot((u - k.cx) / k.fx, (v - k.cy) / k.fy), distance = radius - std::sqrt(fold2);
      if (std::abs(distance) < 2e-3) continue;  // the fold is found in steps of 1e-3
      const size_t i = size_t{v} * 320 + u;
      ASSERT_EQ(r.left.x[i] == -2 && r.left.y[i] == -2, distance > 0) << u << ", " << v;
      ++(distance > 0 ? beyond : within);
    }
  EXPECT_GT(within, 10'000);
  EXPECT_GT(beyond, 10'000);
}

TEST(OpenCv, UndistortsPixelsToTheSameRays) {
  Rigs rigs;
  int compared = 0;
  for (int n = 0; n < 60; ++n) {
    const simsense_camera camera = rigs.next().left;
    std::vector<cv::Point2d> pixels, rays;
    for (uint32_t v = 0; v < camera.height; v += 7)
      for (uint32_t u = 0; u < camera.width; u += 7) pixels.emplace_back(u, v);
    cv::undistortPoints(pixels, rays, matrix(camera.k, 3, 3), matrix(camera.lens.distortion, 1, 8), cv::noArray(), cv::noArray(),
                        cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 500, 1e-12));
    for (size_t i = 0; i < pixels.size(); ++i) {
      const ks::LensImage back = ks::distorted(camera.lens, rays[i].x, rays[i].y);
      const double residual_px =
          std::hypot(camera.k[0] * back.x + camera.k[2] - pixels[i].x, camera.k[4] * back.y + camera.k[5] - pixels[i].y);
      if (residual_px > 1e-9) continue;  // OpenCV's steps have not arrived: nothing to compare with
      const Normalised ray = ray_of_pixel(camera, pixels[i].x, pixels[i].y);
      ASSERT_NEAR(ray[0], rays[i].x, 1e-9) << "camera " << n;
      ASSERT_NEAR(ray[1], rays[i].y, 1e-9) << "camera " << n;
      ++compared;
    }
  }
  EXPECT_GT(compared, 40'000);
}

TEST(RayOfPixel, BeyondTheFoldIsThatOfAPinhole) {
  simsense_camera camera = simsense_test::camera(640, 480, 400);
  camera.lens.distortion[0] = -0.6;  // no ray is bent farther out than r = sqrt(1 / 1.8) to 2 / 3 of that: 199 pixels
  const Normalised ray = ray_of_pixel(camera, 639, 239.5);
  EXPECT_NEAR(ray[0], 319.5 / 400, 1e-12);
  EXPECT_NEAR(ray[1], 0, 1e-12);
}

TEST(RectifyPair, HeedsRotationsOfAMicroradian) {
  // OpenCV takes a rotation below 1e-5 for none.
  simsense_rig_desc rig = simsense_test::ideal_rig(640, 480, 600);
  simsense_test::set_pose(rig.left_to_right, 8e-6, 0, 0, -0.05, 0, 0);
  const RectifiedPair pair = rectify_pair(rig.left, rig.right, rigid(rig.left_to_right), false);
  EXPECT_NEAR(pair.left[7], 4e-6, 1e-9);
  EXPECT_NEAR(pair.right[7], -4e-6, 1e-9);
}
