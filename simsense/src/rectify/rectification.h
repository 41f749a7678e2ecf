// SPDX-License-Identifier: Apache-2.0
// From a calibrated rig to a row-aligned pair: one pinhole for both rectified cameras, the baseline, and where each rectified pixel lies in
// its source (rectify/stereo_rectify.h).
//
// Both principal points coincide, so that disparity 0 is infinity, and the focal length stays the sensor's own. The published SimSense
// shrinks the image until every source pixel fits, and loses disparity resolution by the same factor. A rig that is rectified already keeps
// its K bit for bit.
#pragma once

#include <vector>

#include "rig/rig.h"

namespace simsense {

struct StereoGeometry {
  Pinhole camera;                  // the rectified left camera; the right one has the same but for cx
  double baseline_m = 0;           // > 0
  double disparity_offset_px = 0;  // cx_right - cx_left; z = fx * baseline / (disparity + offset)
  Rotation left_to_rectified{1, 0, 0, 0, 1, 0, 0, 0, 1};
};

/// The source coordinates of each rectified pixel, packed [height][width].
struct RemapTable {
  uint32_t width = 0, height = 0;
  std::vector<float> x, y;
};

struct Rectification {
  StereoGeometry geometry;
  RemapTable left, right;  // empty when the rig is rectified already
  [[nodiscard]] bool is_identity() const { return left.x.empty(); }
};

/// Computes the rectification of a rig that check_rig() accepts. Throws KS_ERROR_INVALID_ARGUMENT unless the cameras stand side by side,
/// the right one to the right, and are rectified if the rig says so.
Rectification make_rectification(const simsense_rig_desc& rig);

}  // namespace simsense
