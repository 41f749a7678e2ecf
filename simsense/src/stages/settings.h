// SPDX-License-Identifier: Apache-2.0
// The settings of one call's stages: rules that follow from rig, parameters and imagers, computed once for both back ends. Plain values.
#pragma once

#include <span>

#include "checks/checks.h"
#include "depth/depth.h"
#include "match/region.h"
#include "signal/imager.h"
#include "signal/key.h"
#include "simsense/simsense.h"
#include "stages/prepared_rig.h"

namespace simsense {

struct StageSettings {
  /// parameters must have been checked. imagers must outlive this.
  StageSettings(const PreparedRig& rig, const simsense_parameters& parameters, const Imager (&imagers)[2],
                std::span<const uint64_t> noise_seeds = {});

  const Imager (&imagers)[2];
  bool wide;            // the matcher sees 16-bit images, because either imager gives them
  uint32_t extra_bits;  // of both imagers' counts, which images lack
  uint64_t noise_seed, frame_index;
  std::span<const uint64_t> noise_seeds;  // of each pair, where they have their own; outlive this

  bool remaps_nearest;  // of the rectification: the nearest pixel, else bilinear
  bool drops_padding;   // what was matched where the rectified image shows nothing is invalid

  MatchParameters match;
  Region wanted, used;  // the region of interest, and what must be matched to find its disparities
  bool is_partial;      // that is not the whole image
  bool low_memory;

  uint32_t speckle_max_size;  // 0 = no speckle filter
  float speckle_max_diff_px;
  EdgeParameters edges;
  HoleFilling hole_filling;
  TextureParameters texture;
  DetectionNoise noise;
  ReasonParameters reason;

  DepthRange depth_range;
  Splat splat;  // of the registration

  [[nodiscard]] float invalid_disparity() const { return match.invalid_disparity(); }
  [[nodiscard]] NoiseKey noise_key(uint32_t pair, uint32_t side) const;
};

/// The region of interest; the whole image if there is none.
Region wanted_region(const simsense_parameters& parameters, uint32_t width, uint32_t height);

}  // namespace simsense
