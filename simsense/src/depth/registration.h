// Registration: depth of the rectified left camera seen from the RGB camera. Each measured pixel is a point that lands on the nearest RGB
// pixel; the nearest point wins. The z-buffer is a minimum, so the result does not depend on order or on the number of workers. The
// rectified pixel's ray is rotated back by R1 before left_to_rgb, and an unmeasured pixel lands nowhere (the published SimSense does
// neither; SIMSENSE_FAULT_REGISTRATION_UNRECTIFIED and _SPLAT_INVALID are its ways). Thread rule: externally synchronised (it owns its
// z-buffer).
#pragma once

#include <vector>

#include "depth/depth.h"
#include "depth/distortion.h"

namespace simsense {

class Registration {
 public:
  Registration(const StereoGeometry& left, uint32_t width, uint32_t height, const simsense_camera& rgb, const Rigid& left_to_rgb);
  /// With the faults of rig.faults.
  Registration(const simsense_rig_desc& rig, const StereoGeometry& left);

  /// depth: packed [height][width] of the rectified left camera. out: packed [rgb.height][rgb.width], z in the RGB camera, 0 = nothing
  /// landed there. splat_size: each point covers n x n pixels about its own; where n is even, one more to the left and above.
  void apply(const float* depth, const DepthRange& range, uint32_t splat_size, float* out, ks::ThreadPool& workers);

  /// A pixel's ray in the RGB camera, per unit depth: step times column plus its row's start.
  [[nodiscard]] std::array<float, 3> ray_step() const;
  [[nodiscard]] std::array<float, 3> ray_start(uint32_t y) const;
  [[nodiscard]] const std::array<float, 3>& translation() const { return translation_; }
  [[nodiscard]] bool is_unrectified() const { return unrectified_; }
  [[nodiscard]] bool splats_invalid() const { return splat_invalid_; }
  /// nullptr where the RGB camera has no distortion.
  [[nodiscard]] const BrownConrady* distortion() const { return distorted_ ? &distortion_ : nullptr; }

 private:
  void splat_row(const float* depth, uint32_t y);
  void splat_row_unrectified(const float* depth, uint32_t y);
  void splat(float x, float y, float z);
  void keep_nearest(float column, float row, float z);
  void resolve_row(const DepthRange& range, uint32_t splat_size, uint32_t y, float* out) const;

  uint32_t width_, height_, rgb_width_, rgb_height_;
  std::array<double, 9> pixel_to_rgb_;  // rotation * K_rectified^-1: direction per unit depth of a homogeneous left pixel
  std::array<float, 3> translation_;    // metres
  bool unrectified_ = false, splat_invalid_ = false;
  float fx_, fy_, cx_, cy_;
  bool distorted_;
  BrownConrady distortion_;
  std::vector<uint32_t> nearest_;  // bits of a positive float sort as the float does
};

}  // namespace simsense
