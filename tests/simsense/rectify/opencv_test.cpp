// SPDX-License-Identifier: Apache-2.0
// Rectification, its maps and undistorted rays against OpenCV's stereoRectify, initUndistortRectifyMap and undistortPoints, over many rigs.
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <random>

#include "rectify/rectification.h"
#include "rectify/stereo_rectify.h"
#include "rig/undistort.h"
#include "simsense/rig_samples.h"

using namespace simsense;

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

TEST(RayOfPixel, IsBentBackToItsPixel) {
  Rigs rigs;
  for (int n = 0; n < 100; ++n) {
    const simsense_camera camera = rigs.next().left;
    const ks_lens& lens = camera.lens;
    for (double x = -0.4; x < 0.41; x += 0.1)
      for (double y = -0.4; y < 0.41; y += 0.1) {
        const ks::LensImage seen = ks::distorted(lens, x, y);
        const Normalised ray = ray_of_pixel(camera, camera.k[0] * seen.x + camera.k[2], camera.k[4] * seen.y + camera.k[5]);
        ASSERT_NEAR(ray[0], x, 1e-10);
        ASSERT_NEAR(ray[1], y, 1e-10);
      }
  }
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
