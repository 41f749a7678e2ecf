// SPDX-License-Identifier: Apache-2.0
// The settings of one call's stages: rules that follow from rig, parameters and imagers, computed once for both back ends. Plain values.
#pragma once

#include <optional>
#include <span>

#include "checks/checks.h"
#include "depth/depth.h"
#include "match/matcher.h"
#include "rectify/rectification.h"
#include "registration/projection.h"
#include "signal/imager.h"
#include "signal/key.h"
#include "simsense/simsense.h"

namespace simsense {

/// The rig's data for all stages, computed once. Thread rule: immutable.
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

/// Throws KS_ERROR_INVALID_ARGUMENT for the first invalid parameter, with name, value and range.
void check_parameters(const simsense_parameters& parameters);

/// Throws KS_ERROR_INVALID_ARGUMENT if the region of interest does not lie in an image of this size.
void check_region(const simsense_parameters& parameters, uint32_t width, uint32_t height);

MatchParameters match_parameters(const simsense_parameters& parameters);
DepthRange depth_range(const simsense_parameters& parameters);

}  // namespace simsense
