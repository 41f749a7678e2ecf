// SPDX-License-Identifier: Apache-2.0
// The rig's data for all stages, computed once. Thread rule: immutable.
#pragma once

#include <optional>

#include "depth/rays.h"
#include "rectify/rectification.h"
#include "registration/projection.h"

namespace simsense {

struct PreparedRig {
  /// Throws KS_ERROR_INVALID_ARGUMENT for an invalid rig, with the field and its value.
  explicit PreparedRig(const simsense_rig_desc& rig);

  simsense_rig_desc rig;
  Rectification rectification;
  std::optional<RgbProjection> rgb;  // where the rig has an RGB camera
  PixelRays rays;                    // of the points' camera: the RGB one, else the rectified left one

  [[nodiscard]] uint32_t width() const { return rig.left.width; }
  [[nodiscard]] uint32_t height() const { return rig.left.height; }
  [[nodiscard]] size_t pixels() const { return size_t{width()} * height(); }
};

}  // namespace simsense
