// Matching cost: Hamming distance of census words, and its sum over a block.
#pragma once

#include "reference/volume.h"

namespace simsense::reference {

/// cost(x, y, d) = number of bits that differ between left (x, y) and right (max(x - d, 0), y).
Volume<uint16_t> hamming_cost(const Grid<uint32_t>& left, const Grid<uint32_t>& right, size_t disparities);

/// Sum over the block centred at each pixel, per disparity; pixels outside the image take the cost of the nearest one inside.
Volume<uint16_t> block_sum(const Volume<uint16_t>& cost, size_t block_width, size_t block_height);

}  // namespace simsense::reference
