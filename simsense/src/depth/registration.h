// Registration: depth of the rectified left camera seen from the RGB camera. Each measured pixel is a point that lands on the nearest RGB
// pixel; the nearest point wins. The z-buffer is a minimum, so the result does not depend on order or on the number of workers. The
// rectified pixel's ray is rotated back by R1 before left_to_rgb, an unmeasured pixel lands nowhere, and a point just beyond the image's
// border covers what its splat reaches of it (the published SimSense does none of these; SIMSENSE_FAULT_REGISTRATION_UNRECTIFIED,
// _SPLAT_INVALID and _SPLAT_CLIPPED are its ways). Thread rule: externally synchronised (it owns its z-buffer).
#pragma once

#include <vector>

#include "depth/depth.h"
#include "depth/distortion.h"
#include "shared/depth_push.h"

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
  /// How far beyond the image's border points are kept, pixels.
  [[nodiscard]] int32_t landing_margin() const { return landing_margin_; }
  /// nullptr where the RGB camera has no distortion.
  [[nodiscard]] const BrownConrady* distortion() const { return distorted_ ? &distortion_ : nullptr; }

 private:
  static constexpr size_t chunk = 256;
  /// Where points land: cells of the z-buffer, -1 = nowhere.
  struct Landings {
    std::array<int32_t, chunk> cell;
    std::array<float, chunk> z;
  };
  void splat_row(const float* depth, uint32_t y);
  void project(const float* depth, size_t first, size_t count, uint32_t y, Landings& out) const;
  void project_unrectified(const float* depth, size_t first, size_t count, uint32_t y, Landings& out) const;
  void keep_nearest(const Landings& landings, size_t count);
  [[nodiscard]] int32_t cell_at(float column, float row, bool seen) const;
  [[nodiscard]] size_t pitch() const { return rgb_width_ + 2 * SPLAT_MARGIN; }
  void resolve_row(const DepthRange& range, uint32_t splat_size, uint32_t y, int32_t* scratch, float* out) const;

  uint32_t width_, height_, rgb_width_, rgb_height_;
  std::array<double, 9> pixel_to_rgb_;  // rotation * K_rectified^-1: direction per unit depth of a homogeneous left pixel
  std::array<float, 3> translation_;    // metres
  bool unrectified_ = false, splat_invalid_ = false;
  int32_t landing_margin_ = SPLAT_MARGIN;
  float fx_, fy_, cx_, cy_;
  bool distorted_;
  BrownConrady distortion_;
  std::vector<int32_t> nearest_;  // the image and SPLAT_MARGIN around it; bits of a positive float sort as the float does
};

}  // namespace simsense
