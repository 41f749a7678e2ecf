// SPDX-License-Identifier: Apache-2.0
#include "stages/settings.h"

#include <algorithm>

#include "match/detection.h"

namespace simsense {
namespace {

/// Dilation is the older name of a splat of 2 x 2.
Splat splat_of(const simsense_parameters& p) { return {.size = std::max(p.splat_size, p.depth_dilation != 0 ? 2u : 1u)}; }

/// Variance of an imager's counts, as if they had 8 bits: dark + per_count v + per_count2 v^2, and no less than `least`.
struct CountVariance {
  double dark, per_count, per_count2, least;
};

CountVariance variance_of(const Imager& imager, const simsense_parameters& p) {
  const simsense_signal& s = imager.signal();
  const double unit = 1.0 / (1u << (s.bit_depth - 8)), rounding = unit * unit / 12;
  if (!imager.has_noise()) {                          // recorded counts
    const double step = unit * (1u << s.extra_bits);  // of p's DN
    return {p.noise_dn2 * step * step + rounding, p.noise_dn2_per_dn * step, 0, rounding};
  }
  const double dn_per_e = double{s.conversion_gain_dn_per_e} * s.gain, black = black_dn(s);
  const auto squared = [](double value) { return value * value; };
  const double shot = dn_per_e * squared(s.shot_noise), uneven = squared(s.prnu);
  const double electrons = squared(s.read_noise_e) + squared(s.dsnu_e) + squared(s.row_fixed_e) + squared(s.column_fixed_e) +
                           squared(s.row_noise_e) + squared(s.column_noise_e);
  const double still = squared(dn_per_e) * electrons + squared(s.adc_noise_dn);  // light or not
  return {(still - shot * black + uneven * squared(black)) * unit * unit + rounding, (shot - 2 * uneven * black) * unit, uneven,
          still * unit * unit + rounding};
}

DetectionNoise noise_of(const Imager (&imagers)[2], const simsense_parameters& p, uint32_t window) {
  const CountVariance left = variance_of(imagers[0], p), right = variance_of(imagers[1], p);
  return detection_noise(left.dark + right.dark, left.per_count + right.per_count, left.per_count2 + right.per_count2,
                         left.least + right.least, detection_mean_side(window));
}

const simsense_rig_desc& checked(const simsense_rig_desc& rig) {
  check_rig(rig);
  return rig;
}

PixelRays point_rays(const simsense_rig_desc& rig, const StereoGeometry& geometry) {
  return rig.rgb.width ? PixelRays(rig.rgb) : PixelRays(geometry.camera, rig.left.width, rig.left.height);
}

}  // namespace

PreparedRig::PreparedRig(const simsense_rig_desc& desc)
    : rig(checked(desc)), rectification(make_rectification(rig)), rays(point_rays(rig, rectification.geometry)) {
  if (rig.rgb.width) rgb.emplace(rig, rectification.geometry);
}

Region wanted_region(const simsense_parameters& p, uint32_t width, uint32_t height) {
  if (p.roi_width == 0) return {0, 0, width, height};
  return {p.roi_x, p.roi_y, p.roi_x + p.roi_width, p.roi_y + p.roi_height};
}

StageSettings::StageSettings(const PreparedRig& rig, const simsense_parameters& p, const Imager (&both)[2], std::span<const uint64_t> seeds)
    : imagers(both),
      wide(both[0].is_wide() || both[1].is_wide()),
      extra_bits(both[0].signal().extra_bits),
      noise_seed(p.noise_seed),
      frame_index(p.frame_index),
      noise_seeds(seeds),
      remaps_nearest((rig.rig.faults & SIMSENSE_FAULT_REMAP_NEAREST) != 0),
      drops_padding(!rig.rectification.is_identity() && !(rig.rig.faults & SIMSENSE_FAULT_PADDING_MATCHED)),
      match(match_parameters(p)),
      wanted(wanted_region(p, rig.width(), rig.height())),
      used(reach(wanted, match, rig.width(), rig.height())),
      is_partial(!(wanted == used && used == Region{0, 0, rig.width(), rig.height()})),
      low_memory(rig.rig.low_memory != 0),
      speckle_max_size(p.speckle_max_size),
      speckle_max_diff_px(p.speckle_max_diff_px),
      edges{p.edge_step_px, p.right_border_px},
      hole_filling(static_cast<HoleFilling>(p.hole_filling)),
      texture{p.min_texture_dn << extra_bits},
      noise(noise_of(both, p, match.detection_side())),
      reason{p.census_width, p.census_height, p.low_texture_dn << extra_bits, (1u << both[0].signal().bit_depth) - 1},
      depth_range(simsense::depth_range(p)),
      splat(splat_of(p)) {
  match.left_bits = both[0].signal().bit_depth;
  match.p2_full_gradient_dn <<= extra_bits;
  match.right_bits = both[1].signal().bit_depth;
}

NoiseKey StageSettings::noise_key(uint32_t pair, uint32_t side) const {
  const simsense_signal& s = imagers[side].signal();
  if (!noise_seeds.empty()) return {noise_seeds[pair], frame_index, s.scene_index, s.first_view, side};
  return {noise_seed, frame_index, s.scene_index, s.first_view + pair, side};
}

}  // namespace simsense
