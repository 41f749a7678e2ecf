// SPDX-License-Identifier: Apache-2.0
// How the rectified left camera's pixels are seen by the RGB camera: both back ends register through it. The rectified pixel's ray is
// rotated back by R1 before left_to_rgb, an unmeasured pixel lands nowhere, and a point just beyond the image's border covers what its
// splat reaches of it (the published SimSense does none of these; SIMSENSE_FAULT_REGISTRATION_UNRECTIFIED, _SPLAT_INVALID and
// _SPLAT_CLIPPED are its ways). Thread rule: immutable.
#pragma once

#include <array>

#include "rectify/rectification.h"
#include "shared/depth_push.h"

namespace simsense {

/// The size x size pixels that each point covers, centred on its own; an even size covers one more to the left and above.
struct Splat {
  uint32_t size = 1;
  /// Pixels that it covers to the right and below.
  [[nodiscard]] constexpr uint32_t reach() const { return (size - 1) / 2; }
};
static_assert(Splat{.size = 15}.reach() == SPLAT_MARGIN);

class RgbProjection {
 public:
  RgbProjection(const StereoGeometry& left, const simsense_camera& rgb, const Rigid& left_to_rgb);
  /// Takes the faults in rig.faults into account.
  RgbProjection(const simsense_rig_desc& rig, const StereoGeometry& left);

  /// A pixel's ray in the RGB camera, per metre of depth: ray_step() times the column, plus the row's start.
  [[nodiscard]] std::array<float, 3> ray_step() const;
  [[nodiscard]] std::array<float, 3> ray_start(uint32_t y) const;
  /// The same in double precision, [3][3]: direction per metre of depth for a homogeneous left pixel.
  [[nodiscard]] const std::array<double, 9>& pixel_to_rgb() const { return pixel_to_rgb_; }
  [[nodiscard]] const std::array<float, 3>& translation() const { return translation_; }  // metres
  [[nodiscard]] bool is_unrectified() const { return unrectified_; }
  [[nodiscard]] bool splats_invalid() const { return splat_invalid_; }
  /// Pixels beyond the image's border in which points are kept.
  [[nodiscard]] int32_t landing_margin() const { return landing_margin_; }
  [[nodiscard]] const LensParameters& lens() const { return lens_; }
  [[nodiscard]] uint32_t width() const { return rgb_width_; }
  [[nodiscard]] uint32_t height() const { return rgb_height_; }
  [[nodiscard]] std::array<float, 2> focal_px() const { return {fx_, fy_}; }
  [[nodiscard]] std::array<float, 2> centre_px() const { return {cx_, cy_}; }

 private:
  uint32_t rgb_width_, rgb_height_;
  std::array<double, 9> pixel_to_rgb_{};
  std::array<float, 3> translation_{};
  bool unrectified_ = false, splat_invalid_ = false;
  int32_t landing_margin_ = SPLAT_MARGIN;
  float fx_, fy_, cx_, cy_;
  LensParameters lens_;
};

}  // namespace simsense
