// SPDX-License-Identifier: Apache-2.0
#include "simsense/reference/cost.h"

#include <algorithm>
#include <bit>

namespace simsense::reference {

Volume<uint16_t> hamming_cost(const Grid<uint64_t>& left, const Grid<uint64_t>& right, size_t disparities, int32_t min_disparity) {
  const ptrdiff_t last_x = static_cast<ptrdiff_t>(left.width) - 1;
  Volume<uint16_t> cost(left.width, left.height, disparities);
  for (size_t y = 0; y < left.height; ++y) {
    for (size_t x = 0; x < left.width; ++x) {
      for (size_t d = 0; d < disparities; ++d) {
        const ptrdiff_t right_x = std::clamp<ptrdiff_t>(static_cast<ptrdiff_t>(x) - min_disparity - static_cast<ptrdiff_t>(d), 0, last_x);
        cost.at(x, y)[d] = static_cast<uint16_t>(std::popcount(left.at(x, y) ^ right.at(static_cast<size_t>(right_x), y)));
      }
    }
  }
  return cost;
}

namespace {

/// Sum over `length` neighbours along one axis, given by the step (1, 0) or (0, 1).
Volume<uint16_t> line_sum(const Volume<uint16_t>& cost, size_t length, ptrdiff_t step_x, ptrdiff_t step_y) {
  const ptrdiff_t half = static_cast<ptrdiff_t>(length / 2);
  const ptrdiff_t last_x = static_cast<ptrdiff_t>(cost.width) - 1, last_y = static_cast<ptrdiff_t>(cost.height) - 1;
  Volume<uint16_t> sum(cost.width, cost.height, cost.disparities);
  for (ptrdiff_t y = 0; y <= last_y; ++y) {
    for (ptrdiff_t x = 0; x <= last_x; ++x) {
      uint16_t* out = sum.at(static_cast<size_t>(x), static_cast<size_t>(y));
      for (ptrdiff_t k = -half; k <= half; ++k) {
        const ptrdiff_t nx = std::clamp<ptrdiff_t>(x + k * step_x, 0, last_x), ny = std::clamp<ptrdiff_t>(y + k * step_y, 0, last_y);
        const uint16_t* in = cost.at(static_cast<size_t>(nx), static_cast<size_t>(ny));
        for (size_t d = 0; d < cost.disparities; ++d) out[d] = static_cast<uint16_t>(out[d] + in[d]);
      }
    }
  }
  return sum;
}

}  // namespace

Volume<uint16_t> block_sum(const Volume<uint16_t>& cost, size_t block_width, size_t block_height) {
  return line_sum(line_sum(cost, block_width, 1, 0), block_height, 0, 1);
}

}  // namespace simsense::reference
