// From the aggregated volume to disparities: winner, uniqueness, subpixel step, left-right check, median.
#pragma once

#include "matcher.h"
#include "reference/volume.h"

namespace simsense::reference {

/// Disparity of lowest cost in the left image, the smaller one on a tie; -1 where some d with |d - winner| > 1 has
/// cost * (100 - uniqueness_ratio) < winner's cost * 100. The subpixel step needs both neighbours: none at d = 0 and d = D - 1, and none
/// where the costs are equal. block_cost: what the equiangular step looks at, the sums before aggregation; nullptr = the aggregated costs.
Grid<float> left_winner(const Volume<uint16_t>& cost, uint32_t uniqueness_ratio, Subpixel subpixel, const Volume<uint16_t>* block_cost);

/// Disparity of lowest cost as seen from the right pixel (x, y): over the left pixels (x + d, y) inside the image, at d; the smaller one on
/// a tie.
Grid<uint32_t> right_winner(const Volume<uint16_t>& cost);

/// -1 where the left disparity, rounded, points outside the right image or differs by more than max_diff from the right disparity there.
Grid<float> left_right_check(const Grid<float>& left, const Grid<uint32_t>& right, int32_t max_diff);

/// Median of size x size values, invalid ones (-1) included; pixels nearer than size / 2 to the border are copied.
Grid<float> median(const Grid<float>& disparity, size_t size);

}  // namespace simsense::reference
