// SPDX-License-Identifier: Apache-2.0
// The choices of the matcher and the reasons it gives, as enumerations. Their numbers are those of the public header.
#pragma once

#include <cstdint>

#include "shared/choices.h"

namespace simsense {

/// The pixels of the window that a census word compares.
enum class CensusKind : uint8_t {
  center_symmetric = CENSUS_CENTER_SYMMETRIC,  // each pixel with its mirror through the centre: half the bits
  plain = CENSUS_PLAIN,                        // each pixel with the centre
};

/// How a match is placed between whole disparities, from the costs at winner - 1, winner and winner + 1.
enum class Subpixel : uint8_t {
  none = SUBPIXEL_NONE,
  parabola = SUBPIXEL_PARABOLA,  // vertex of the parabola through the aggregated costs, as the published SimSense; pulls towards whole
                                 // pixels by up to 0.2
  equiangular = SUBPIXEL_EQUIANGULAR,  // apex of the V through the block's costs; through the aggregated ones where the block is 1x1 or has
                                       // no minimum there
  equiangular_summed = SUBPIXEL_EQUIANGULAR_SUMMED,  // through the aggregated ones everywhere: less noise, more pull
  lucas_kanade = SUBPIXEL_LUCAS_KANADE,  // the same, and after the median the counts themselves decide (match/refine.h): no pull
};

/// The value that an invalid pixel takes from its row (cpu/checks/checks.h).
enum class HoleFilling : uint8_t {
  keep = HOLES_KEEP,
  left = HOLES_LEFT,              // the valid pixel to the left: what a left camera's occlusions border on
  background = HOLES_BACKGROUND,  // the farther of the valid pixels to the left and right; either alone at the image's border (the
                                  // interpolation of the KITTI stereo benchmark's development kit: Geiger, Lenz, Urtasun, CVPR 2012)
};

/// Why a pixel has no measurement. A matcher knows the first five.
enum class MatchReason : uint8_t { MATCH_REASONS };

}  // namespace simsense
