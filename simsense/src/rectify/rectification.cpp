#include "rectify/rectification.h"

#include <cmath>
#include <cstring>
#include <opencv2/calib3d.hpp>

#include "device/error.h"

namespace simsense {
namespace {

// What a pair that calls itself rectified may leave over: larger residuals shift rows by pixels and ruin the match silently.
constexpr double max_rotation_rad = 0.01, max_sideways = 0.05 /* of the baseline */, max_focal_difference = 0.01 /* relative */,
                 max_row_offset_px = 1;
// Beyond these it is a slip of units.
constexpr double min_baseline_m = 1e-4, max_baseline_m = 1e3;

void check_side_by_side(const std::array<double, 3>& t) {
  if (!(t[0] < 0))
    ks::fail(KS_ERROR_INVALID_ARGUMENT,
             "left_to_right has x translation %g m: must be negative (minus the baseline). Swap the images, or give the inverse transform",
             t[0]);
  const double baseline_m = std::hypot(t[0], t[1], t[2]);
  if (baseline_m < min_baseline_m || baseline_m > max_baseline_m)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "left_to_right moves the camera by %g m: a baseline must be %g..%g m; translations are in metres",
             baseline_m, min_baseline_m, max_baseline_m);
}

void check_rectified(const simsense_rig_desc& rig, const Rigid& pose) {
  const double angle = rotation_angle(pose.rotation);
  if (angle > max_rotation_rad)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "rectified is set, but left_to_right rotates by %g rad (limit %g): set rectified = 0", angle,
             max_rotation_rad);
  const auto& t = pose.translation;
  if (std::hypot(t[1], t[2]) > max_sideways * -t[0])
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "rectified is set, but left_to_right moves %g, %g m in y, z beside %g m in x: set rectified = 0",
             t[1], t[2], t[0]);
  const Pinhole l = pinhole(rig.left), r = pinhole(rig.right);
  if (std::abs(l.fx - r.fx) > max_focal_difference * l.fx || std::abs(l.fy - r.fy) > max_focal_difference * l.fy)
    ks::fail(KS_ERROR_INVALID_ARGUMENT,
             "rectified is set, but the focal lengths differ: left %g, %g, right %g, %g pixels: set rectified = 0", l.fx, l.fy, r.fx, r.fy);
  if (std::abs(l.cy - r.cy) > max_row_offset_px)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "rectified is set, but cy is %g left and %g right: rows are not aligned: set rectified = 0", l.cy,
             r.cy);
  if (is_distorted(rig.left) || is_distorted(rig.right))
    ks::fail(KS_ERROR_INVALID_ARGUMENT,
             "rectified is set, but left.distortion[0] = %g, right.distortion[0] = %g: a rectified pair has none: set rectified = 0",
             rig.left.distortion[0], rig.right.distortion[0]);
}

cv::Mat matrix3(const double* k) { return cv::Mat(3, 3, CV_64F, const_cast<double*>(k)).clone(); }

RemapTable remap_table(const simsense_camera& camera, const cv::Mat& rotation, const cv::Mat& projection) {
  cv::Mat x, y;
  const cv::Mat coefficients(1, 5, CV_64F, const_cast<double*>(camera.distortion));
  const cv::Size size(static_cast<int>(camera.width), static_cast<int>(camera.height));
  cv::initUndistortRectifyMap(matrix3(camera.k), coefficients, rotation, projection, size, CV_32FC1, x, y);
  RemapTable table{camera.width, camera.height, {}, {}};
  table.x.assign(x.ptr<float>(), x.ptr<float>() + x.total());
  table.y.assign(y.ptr<float>(), y.ptr<float>() + y.total());
  return table;
}

/// The rectifier's focal length and baseline, in single precision as the published SimSense hands them on.
void take_focal_and_baseline(const cv::Mat& q, StereoGeometry& g) {
  g.camera.fx = g.camera.fy = static_cast<float>(q.at<double>(2, 3));
  g.baseline_m = static_cast<float>(1.0 / q.at<double>(3, 2));
  g.disparity_offset_px = 0;
}

Rectification rectify_with_opencv(const simsense_rig_desc& rig, const Rigid& pose) {
  const cv::Mat rotation = matrix3(pose.rotation.data());
  const cv::Mat translation(3, 1, CV_64F, const_cast<double*>(pose.translation.data()));
  const cv::Mat left_coefficients(1, 5, CV_64F, const_cast<double*>(rig.left.distortion));
  const cv::Mat right_coefficients(1, 5, CV_64F, const_cast<double*>(rig.right.distortion));
  const cv::Size size(static_cast<int>(rig.left.width), static_cast<int>(rig.left.height));
  cv::Mat r1, r2, p1, p2, q;
  cv::stereoRectify(matrix3(rig.left.k), left_coefficients, matrix3(rig.right.k), right_coefficients, size, rotation, translation, r1, r2,
                    p1, p2, q, cv::CALIB_ZERO_DISPARITY, rig.faults & SIMSENSE_FAULT_RECTIFIED_SHRUNK ? 1 : -1);
  Rectification out;
  StereoGeometry& g = out.geometry;
  g.camera = {p1.at<double>(0, 0), p1.at<double>(1, 1), p1.at<double>(0, 2), p1.at<double>(1, 2)};
  g.baseline_m = -p2.at<double>(0, 3) / p2.at<double>(0, 0);
  g.disparity_offset_px = p2.at<double>(0, 2) - p1.at<double>(0, 2);
  if (!(g.baseline_m > 0) || !(g.camera.fx > 0))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "left_to_right = [%g %g %g] m cannot be rectified into rows: the cameras must stand side by side",
             pose.translation[0], pose.translation[1], pose.translation[2]);
  if (rig.faults & SIMSENSE_FAULT_FOCAL_FROM_RECTIFIER) take_focal_and_baseline(q, g);
  if (rig.rectified != 0) {
    g.camera.cx = rig.left.k[2];
    g.camera.cy = rig.left.k[5];
    return out;
  }
  std::memcpy(g.left_to_rectified.data(), r1.ptr<double>(), sizeof(Rotation));
  out.left = remap_table(rig.left, r1, p1);
  out.right = remap_table(rig.right, r2, p2);
  return out;
}

}  // namespace

Rectification make_rectification(const simsense_rig_desc& rig) {
  const Rigid pose = rigid(rig.left_to_right);
  check_side_by_side(pose.translation);
  if (rig.rectified == 0 || (rig.faults & SIMSENSE_FAULT_FOCAL_FROM_RECTIFIER)) return rectify_with_opencv(rig, pose);
  check_rectified(rig, pose);
  Rectification out;
  out.geometry.camera = pinhole(rig.left);
  out.geometry.baseline_m = -pose.translation[0];
  out.geometry.disparity_offset_px = rig.right.k[2] - rig.left.k[2];
  return out;
}

}  // namespace simsense
