// SPDX-License-Identifier: Apache-2.0
#include "rectify/rectification.h"

#include <cmath>
#include <limits>

#include "device/error.h"
#include "ks/lens.hpp"
#include "rectify/stereo_rectify.h"
#include "rig/rig.h"
#include "rig/rotation.h"

namespace simsense {
namespace {

// The largest residuals of a pair that calls itself rectified: larger residuals shift rows by pixels and ruin the match silently.
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
  if (is_distorting(rig.left.lens) || is_distorting(rig.right.lens))
    ks::fail(KS_ERROR_INVALID_ARGUMENT,
             "rectified is set, but left.lens.distortion[0] = %g, right.lens.distortion[0] = %g: a rectified pair has no lenses: set "
             "rectified = 0",
             rig.left.lens.distortion[0], rig.right.lens.distortion[0]);
}

/// Each rectified pixel's ray, turned back and bent by the source's lens. Beyond the fold of the lens the ray is not seen: its pixel lies
/// outside the source.
RemapTable remap_table(const simsense_camera& source, const Rotation& source_to_rectified, const Pinhole& rectified) {
  const Rotation back = transposed(source_to_rectified);
  constexpr float outside_px = -2;
  const double farthest2 = is_distorting(source.lens) ? ks::lens_fold(source.lens).radius2 : std::numeric_limits<double>::infinity();
  RemapTable table{source.width, source.height, {}, {}};
  table.x.reserve(size_t{source.width} * source.height);
  table.y.reserve(size_t{source.width} * source.height);
  for (uint32_t v = 0; v < source.height; ++v)
    for (uint32_t u = 0; u < source.width; ++u) {
      const Vector3 ray = multiply(back, Vector3{(u - rectified.cx) / rectified.fx, (v - rectified.cy) / rectified.fy, 1});
      const Normalised ideal{ray[0] / ray[2], ray[1] / ray[2]};
      if (!(ideal[0] * ideal[0] + ideal[1] * ideal[1] < farthest2)) {
        table.x.push_back(outside_px);
        table.y.push_back(outside_px);
        continue;
      }
      const ks::LensImage seen = ks::distorted(source.lens, ideal[0], ideal[1]);
      table.x.push_back(static_cast<float>(source.k[0] * seen.x + source.k[2]));
      table.y.push_back(static_cast<float>(source.k[4] * seen.y + source.k[5]));
    }
  return table;
}

/// In single precision, as the published SimSense hands focal length and baseline on.
void take_focal_and_baseline(const RectifiedPair& pair, StereoGeometry& g) {
  g.camera.fx = g.camera.fy = static_cast<float>(pair.camera.fx);
  g.baseline_m = static_cast<float>(pair.baseline_m);
  g.disparity_offset_px = 0;
}

Rectification rectify(const simsense_rig_desc& rig, const Rigid& pose) {
  const RectifiedPair pair = rectify_pair(rig.left, rig.right, pose, (rig.faults & SIMSENSE_FAULT_RECTIFIED_SHRUNK) != 0);
  if (!pair.is_horizontal || !(pair.baseline_m > 0) || !(pair.camera.fx > 0))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "left_to_right = [%g %g %g] m cannot be rectified into rows: the cameras must stand side by side",
             pose.translation[0], pose.translation[1], pose.translation[2]);
  Rectification out;
  StereoGeometry& g = out.geometry;
  g.camera = pair.camera;
  g.baseline_m = pair.baseline_m;
  if (rig.faults & SIMSENSE_FAULT_FOCAL_FROM_RECTIFIER) take_focal_and_baseline(pair, g);
  if (rig.rectified != 0) {
    g.camera.cx = rig.left.k[2];
    g.camera.cy = rig.left.k[5];
    return out;
  }
  g.left_to_rectified = pair.left;
  out.left = remap_table(rig.left, pair.left, pair.camera);
  out.right = remap_table(rig.right, pair.right, pair.camera);
  return out;
}

}  // namespace

Rectification make_rectification(const simsense_rig_desc& rig) {
  const Rigid pose = rigid(rig.left_to_right);
  check_side_by_side(pose.translation);
  if (rig.rectified == 0 || (rig.faults & SIMSENSE_FAULT_FOCAL_FROM_RECTIFIER)) return rectify(rig, pose);
  check_rectified(rig, pose);
  Rectification out;
  out.geometry.camera = pinhole(rig.left);
  out.geometry.baseline_m = -pose.translation[0];
  out.geometry.disparity_offset_px = rig.right.k[2] - rig.left.k[2];
  return out;
}

}  // namespace simsense
