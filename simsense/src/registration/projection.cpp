// SPDX-License-Identifier: Apache-2.0
#include "registration/projection.h"

#include <algorithm>

#include "ks/lens.hpp"
#include "rig/rig.h"

namespace simsense {
namespace {

LensParameters lens_parameters(const ks_lens& lens) {
  LensParameters out{lens.model, {}, is_distorting(lens) ? static_cast<float>(ks::lens_fold(lens).radius2) : 0.0f};
  std::ranges::transform(lens.distortion, out.k, [](double k) { return static_cast<float>(k); });
  return out;
}

}  // namespace

RgbProjection::RgbProjection(const StereoGeometry& left, const simsense_camera& rgb, const Rigid& left_to_rgb)
    : rgb_width_(rgb.width),
      rgb_height_(rgb.height),
      fx_(static_cast<float>(rgb.k[0])),
      fy_(static_cast<float>(rgb.k[4])),
      cx_(static_cast<float>(rgb.k[2])),
      cy_(static_cast<float>(rgb.k[5])),
      lens_(lens_parameters(rgb.lens)) {
  const Rigid rectified_to_rgb = compose(left_to_rgb, {transposed(left.left_to_rectified), {}});
  const Pinhole& k = left.camera;
  for (size_t i = 0; i < 3; ++i) {
    const double* r = rectified_to_rgb.rotation.data() + 3 * i;
    pixel_to_rgb_[3 * i] = r[0] / k.fx;
    pixel_to_rgb_[3 * i + 1] = r[1] / k.fy;
    pixel_to_rgb_[3 * i + 2] = r[2] - r[0] * k.cx / k.fx - r[1] * k.cy / k.fy;
    translation_[i] = static_cast<float>(rectified_to_rgb.translation[i]);
  }
}

RgbProjection::RgbProjection(const simsense_rig_desc& rig, const StereoGeometry& left)
    : RgbProjection(left, rig.rgb, rigid(rig.left_to_rgb)) {
  unrectified_ = (rig.faults & SIMSENSE_FAULT_REGISTRATION_UNRECTIFIED) != 0;
  splat_invalid_ = (rig.faults & SIMSENSE_FAULT_SPLAT_INVALID) != 0;
  if (rig.faults & SIMSENSE_FAULT_SPLAT_CLIPPED) landing_margin_ = 0;
  if (!unrectified_) return;
  // K_rgb * rotation * K_left^-1 and K_rgb * translation: image coordinates times z
  const Pinhole l = pinhole(rig.left), c = pinhole(rig.rgb);
  const Rigid to_rgb = rigid(rig.left_to_rgb);
  const std::array<double, 6> k{c.fx, c.cx, c.fy, c.cy, 0, 1};  // per row: factors of that row and of the last one
  for (size_t i = 0; i < 3; ++i) {
    const auto image = [&](double own, double last) { return k[2 * i] * own + k[2 * i + 1] * last; };
    const double* own = to_rgb.rotation.data() + 3 * i;
    const double* last = to_rgb.rotation.data() + 6;
    const double x = image(own[0], last[0]) / l.fx, y = image(own[1], last[1]) / l.fy;
    pixel_to_rgb_[3 * i] = x;
    pixel_to_rgb_[3 * i + 1] = y;
    pixel_to_rgb_[3 * i + 2] = image(own[2], last[2]) - x * l.cx - y * l.cy;
    translation_[i] = static_cast<float>(image(to_rgb.translation[i], to_rgb.translation[2]));
  }
}

std::array<float, 3> RgbProjection::ray_step() const {
  return {static_cast<float>(pixel_to_rgb_[0]), static_cast<float>(pixel_to_rgb_[3]), static_cast<float>(pixel_to_rgb_[6])};
}

std::array<float, 3> RgbProjection::ray_start(uint32_t y) const {
  std::array<float, 3> start;
  for (size_t i = 0; i < 3; ++i) start[i] = static_cast<float>(pixel_to_rgb_[3 * i + 1] * y + pixel_to_rgb_[3 * i + 2]);
  return start;
}

}  // namespace simsense
