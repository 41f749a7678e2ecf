// SPDX-License-Identifier: Apache-2.0
// Matching cost: Hamming distance of census words, and its sum over a block.
#pragma once

#include "simsense/reference/volume.h"

namespace simsense::reference {

/// cost(x, y, d) = number of bits that differ between left (x, y) and right (x - min_disparity - d, y), the nearest column where there is
/// none.
Volume<uint16_t> hamming_cost(const Grid<uint64_t>& left, const Grid<uint64_t>& right, size_t disparities, int32_t min_disparity = 0);

/// Sum over the block centred at each pixel, per disparity; pixels outside the image take the cost of the nearest one inside.
Volume<uint16_t> block_sum(const Volume<uint16_t>& cost, size_t block_width, size_t block_height);

}  // namespace simsense::reference
