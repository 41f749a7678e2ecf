// SPDX-License-Identifier: Apache-2.0
#include "simsense/reference/sgm.h"

#include <algorithm>
#include <cstdlib>

namespace simsense::reference {
namespace {

/// One pixel further along a path: `path` holds L_r(p-r, .) and becomes L_r(p, .).
void step(const uint16_t* cost, uint32_t p1, uint32_t p2, std::vector<uint32_t>& path) {
  const size_t disparities = path.size();
  const uint32_t lowest = *std::min_element(path.begin(), path.end());
  uint32_t below = path[1];  // d = 0 and d = D - 1 lack one neighbour and use the other twice
  for (size_t d = 0; d < disparities; ++d) {
    const uint32_t here = path[d];
    const uint32_t above = d + 1 < disparities ? path[d + 1] : below;
    path[d] = cost[d] + std::min({here, below + p1, above + p1, lowest + p2}) - lowest;
    below = here;
  }
}

/// Follows the path that starts at (x, y) to the image's border and adds L_r to the sum.
void follow(const Volume<uint16_t>& cost, const JumpPenalty& penalty, uint32_t area, ptrdiff_t x, ptrdiff_t y, ptrdiff_t step_x,
            ptrdiff_t step_y, Volume<uint32_t>& sum) {
  const auto inside = [&] { return x >= 0 && y >= 0 && x < static_cast<ptrdiff_t>(cost.width) && y < static_cast<ptrdiff_t>(cost.height); };
  std::vector<uint32_t> path(cost.disparities, 0);  // all zero before the first pixel makes L_r = C there
  for (bool first = true; inside(); x += step_x, y += step_y, first = false) {
    const size_t px = static_cast<size_t>(x), py = static_cast<size_t>(y);
    const uint32_t p2 = first ? 0 : penalty.between(x, y, x - step_x, y - step_y);
    step(cost.at(px, py), penalty.p1 * area, p2 * area, path);
    for (size_t d = 0; d < path.size(); ++d) sum.at(px, py)[d] += path[d];
  }
}

}  // namespace

uint32_t JumpPenalty::between(ptrdiff_t x, ptrdiff_t y, ptrdiff_t other_x, ptrdiff_t other_y) const {
  if (full_gradient == 0) return p2;
  const auto gradient = static_cast<uint32_t>(std::abs(static_cast<int>(image.at(x, y)) - static_cast<int>(image.at(other_x, other_y))));
  return gradient <= full_gradient ? p2 : std::max(p1, p2 * full_gradient / gradient);
}

Volume<uint16_t> aggregate(const Volume<uint16_t>& cost, uint32_t p1, uint32_t p2) { return aggregate(cost, {p1, p2}, 1, 4); }

Volume<uint16_t> aggregate(const Volume<uint16_t>& cost, const JumpPenalty& penalty, uint32_t block_area, uint32_t path_count) {
  Volume<uint32_t> sum(cost.width, cost.height, cost.disparities);
  const ptrdiff_t right = static_cast<ptrdiff_t>(cost.width) - 1, bottom = static_cast<ptrdiff_t>(cost.height) - 1;
  const ptrdiff_t steps[8][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, -1}, {-1, 1}, {1, -1}};
  for (uint32_t r = 0; r < path_count; ++r) {
    const auto [step_x, step_y] = steps[r];
    for (ptrdiff_t y = 0; y <= bottom; ++y) {
      for (ptrdiff_t x = 0; x <= right; ++x) {  // a path starts at every pixel whose predecessor lies outside
        const ptrdiff_t before_x = x - step_x, before_y = y - step_y;
        const bool enters = before_x < 0 || before_y < 0 || before_x > right || before_y > bottom;
        if (enters) follow(cost, penalty, block_area, x, y, step_x, step_y, sum);
      }
    }
  }
  Volume<uint16_t> mean(cost.width, cost.height, cost.disparities);
  std::transform(sum.data.begin(), sum.data.end(), mean.data.begin(),
                 [path_count](uint32_t s) { return static_cast<uint16_t>(s / path_count); });
  return mean;
}

}  // namespace simsense::reference
