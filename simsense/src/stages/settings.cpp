// SPDX-License-Identifier: Apache-2.0
#include "stages/settings.h"

#include <algorithm>

#include "stages/parameters.h"

namespace simsense {
namespace {

/// Dilation is the older name of a splat of 2 x 2.
Splat splat_of(const simsense_parameters& p) { return {.size = std::max(p.splat_size, p.depth_dilation != 0 ? 2u : 1u)}; }

}  // namespace

Region wanted_region(const simsense_parameters& p, uint32_t width, uint32_t height) {
  if (p.roi_width == 0) return {0, 0, width, height};
  return {p.roi_x, p.roi_y, p.roi_x + p.roi_width, p.roi_y + p.roi_height};
}

StageSettings::StageSettings(const PreparedRig& rig, const simsense_parameters& p, const Imager (&both)[2], std::span<const uint64_t> seeds)
    : imagers(both),
      wide(both[0].is_wide() || both[1].is_wide()),
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
      texture{p.min_texture_dn},
      reason{p.census_width, p.census_height, p.low_texture_dn, (1u << both[0].signal().bit_depth) - 1},
      depth_range(simsense::depth_range(p)),
      splat(splat_of(p)) {
  match.left_bits = both[0].signal().bit_depth;
  match.right_bits = both[1].signal().bit_depth;
}

NoiseKey StageSettings::noise_key(uint32_t pair, uint32_t side) const {
  const simsense_signal& s = imagers[side].signal();
  if (!noise_seeds.empty()) return {noise_seeds[pair], frame_index, s.scene_index, s.first_view, side};
  return {noise_seed, frame_index, s.scene_index, s.first_view + pair, side};
}

}  // namespace simsense
