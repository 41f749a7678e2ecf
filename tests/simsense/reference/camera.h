// SPDX-License-Identifier: Apache-2.0
// A camera and a pose by OpenCV's means, in double precision.
#pragma once

#include <opencv2/calib3d.hpp>

#include "rig/rig.h"

namespace simsense::reference {

/// Pixel that sees a point of the camera's frame.
inline cv::Point2d project(const simsense_camera& camera, const cv::Vec3d& point) {
  std::vector<cv::Point2d> seen;
  cv::projectPoints(std::vector{point}, cv::Vec3d(), cv::Vec3d(), cv::Matx33d(camera.k), cv::Vec<double, 8>(camera.lens.distortion), seen);
  return seen[0];
}

inline cv::Vec3d moved(const Rigid& pose, const cv::Vec3d& point) {
  return cv::Matx33d(pose.rotation.data()) * point + cv::Vec3d(pose.translation.data());
}

}  // namespace simsense::reference
