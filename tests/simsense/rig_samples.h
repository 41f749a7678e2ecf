// SPDX-License-Identifier: Apache-2.0
// Rigs that the tests share.
#pragma once

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "simsense/simsense.h"

namespace simsense_test {

/// Something wrong with a struct, and what is said of it.
template <class T>
struct Fault {
  const char* says;
  void (*make)(T&);
};

inline simsense_camera camera(uint32_t width, uint32_t height, double f) {
  simsense_camera c{};
  c.width = width;
  c.height = height;
  const double k[9] = {f, 0, 0.5 * (width - 1), 0, f, 0.5 * (height - 1), 0, 0, 1};
  std::copy_n(k, 9, c.k);
  return c;
}

inline simsense_parameters small_parameters() {
  simsense_parameters p = simsense_parameters_init();
  p.max_disparity = 32;
  return p;
}

/// Row-major 4x4 from rotations about x, then y, then z (radians) and a translation (metres).
inline void set_pose(double m[16], double rx, double ry, double rz, double tx, double ty, double tz) {
  const double cx = std::cos(rx), sx = std::sin(rx), cy = std::cos(ry), sy = std::sin(ry), cz = std::cos(rz), sz = std::sin(rz);
  const cv::Matx33d x{1, 0, 0, 0, cx, -sx, 0, sx, cx}, y{cy, 0, sy, 0, 1, 0, -sy, 0, cy}, z{cz, -sz, 0, sz, cz, 0, 0, 0, 1};
  cv::Mat pose = cv::Mat::eye(4, 4, CV_64F);
  cv::Mat(z * y * x).copyTo(pose(cv::Rect(0, 0, 3, 3)));
  cv::Mat(cv::Vec3d(tx, ty, tz)).copyTo(pose(cv::Rect(3, 0, 1, 3)));
  std::copy_n(pose.ptr<double>(), 16, m);
}

/// An ideal rectified pair, 50 mm apart.
inline simsense_rig_desc ideal_rig(uint32_t width = 320, uint32_t height = 240, double f = 215) {
  simsense_rig_desc rig = simsense_rig_desc_init();
  rig.left = rig.right = camera(width, height, f);
  rig.left_to_right[3] = -0.05;
  rig.rectified = 1;
  return rig;
}

/// A pair with lenses, unlike focal lengths and a right camera that is rotated by degrees.
inline simsense_rig_desc crooked_rig(uint32_t width = 320, uint32_t height = 240, double f = 215) {
  simsense_rig_desc rig = ideal_rig(width, height, f);
  rig.rectified = 0;
  rig.right.k[0] *= 1.01;
  rig.right.k[4] *= 1.012;
  rig.right.k[5] += 3;
  const double left_lens[5] = {-0.05, 0.01, 4e-4, -3e-4, 0.002}, right_lens[5] = {-0.03, 0.02, -2e-4, 5e-4, 0};
  std::copy_n(left_lens, 5, rig.left.lens.distortion);
  std::copy_n(right_lens, 5, rig.right.lens.distortion);
  set_pose(rig.left_to_right, 0.015, -0.02, 0.01, -0.05, 0.001, -0.0015);
  return rig;
}

}  // namespace simsense_test
