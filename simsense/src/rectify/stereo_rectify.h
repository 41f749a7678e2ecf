// SPDX-License-Identifier: Apache-2.0
// Two cameras turned so that their rows meet: the rotations of both, the focal length and the principal points they share afterwards.
//
// The method is Bouguet's (Camera Calibration Toolbox for Matlab, rectify_stereo_pair.m; the geometry is that of Fusiello, Trucco and
// Verri, A compact algorithm for rectification of stereo pairs, Machine Vision and Applications 12, 2000): each camera takes half of the
// rotation between them, in opposite directions, so that either image is bent least; then both turn until the baseline is their x axis.
// OpenCV's stereoRectify follows it too, and the conventions that no geometry decides (focal length, principal point, how much of the
// images is kept) are OpenCV's, so that pairs calibrated with it come out alike. Thread rule: pure function.
#pragma once

#include "rig/rig.h"

namespace simsense {

struct RectifiedPair {
  Rotation left, right;        // from each camera to its rectified one
  Pinhole camera;              // of both rectified images: infinity has disparity 0
  double baseline_m = 0;       // x of the right camera; > 0 where it stands to the right
  bool is_horizontal = false;  // else the cameras stand above each other, and columns would meet instead of rows
};

/// Rectifies a pair. left_to_right: as in the rig. shrink: reduces the focal length until every source pixel lies in its rectified image
/// (OpenCV's alpha = 1); else it stays (alpha = -1).
RectifiedPair rectify_pair(const simsense_camera& left, const simsense_camera& right, const Rigid& left_to_right, bool shrink);

}  // namespace simsense
