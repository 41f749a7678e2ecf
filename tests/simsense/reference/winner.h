// SPDX-License-Identifier: Apache-2.0
// From the aggregated volume to disparities: winner, uniqueness, subpixel step, confidence.
#pragma once

#include "match/matcher.h"
#include "simsense/reference/volume.h"

namespace simsense::reference {

/// Disparity of lowest cost in the left image, the smaller one on a tie; -1 where some d with |d - winner| > 1 has
/// cost * (100 - uniqueness_ratio) < winner's cost * 100. The subpixel step needs both neighbours: none at d = 0 and d = D - 1, and none
/// where the costs are equal. block_cost: what the equiangular step looks at, the sums before aggregation; nullptr = the aggregated costs.
Grid<float> left_winner(const Volume<uint16_t>& cost, uint32_t uniqueness_ratio, Subpixel subpixel, const Volume<uint16_t>* block_cost);

/// 1 - c1 / c2, with c1 the lowest cost and c2 the lowest of a disparity that is no neighbour of c1's; 0 if c2 is 0. The ratio c2 / c1 is
/// the peak ratio of Hu and Mordohai 2012 ("A quantitative evaluation of confidence measures for stereo vision", PKR). A pixel is unique by
/// ratio r where this is >= r percent.
Grid<float> confidence(const Volume<uint16_t>& cost);

/// Disparity of lowest cost as seen from the right pixel (x, y): over the left pixels (x + min_disparity + d, y) inside the image, at d;
/// the smaller one on a tie. Disparities here and below count from min_disparity.
Grid<uint32_t> right_winner(const Volume<uint16_t>& cost, int32_t min_disparity = 0);

}  // namespace simsense::reference
