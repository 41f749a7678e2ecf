#include "reference/sgm.h"

#include <algorithm>

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
void follow(const Volume<uint16_t>& cost, uint32_t p1, uint32_t p2, ptrdiff_t x, ptrdiff_t y, ptrdiff_t step_x, ptrdiff_t step_y,
            Volume<uint32_t>& sum) {
  const auto inside = [&] { return x >= 0 && y >= 0 && x < static_cast<ptrdiff_t>(cost.width) && y < static_cast<ptrdiff_t>(cost.height); };
  std::vector<uint32_t> path(cost.disparities, 0);  // all zero before the first pixel makes L_r = C there
  for (; inside(); x += step_x, y += step_y) {
    const size_t px = static_cast<size_t>(x), py = static_cast<size_t>(y);
    step(cost.at(px, py), p1, p2, path);
    for (size_t d = 0; d < path.size(); ++d) sum.at(px, py)[d] += path[d];
  }
}

}  // namespace

Volume<uint16_t> aggregate(const Volume<uint16_t>& cost, uint32_t p1, uint32_t p2) {
  Volume<uint32_t> sum(cost.width, cost.height, cost.disparities);
  const ptrdiff_t right = static_cast<ptrdiff_t>(cost.width) - 1, bottom = static_cast<ptrdiff_t>(cost.height) - 1;
  for (ptrdiff_t y = 0; y <= bottom; ++y) {
    follow(cost, p1, p2, 0, y, 1, 0, sum);
    follow(cost, p1, p2, right, y, -1, 0, sum);
  }
  for (ptrdiff_t x = 0; x <= right; ++x) {
    follow(cost, p1, p2, x, 0, 0, 1, sum);
    follow(cost, p1, p2, x, bottom, 0, -1, sum);
  }
  Volume<uint16_t> mean(cost.width, cost.height, cost.disparities);
  std::transform(sum.data.begin(), sum.data.end(), mean.data.begin(), [](uint32_t s) { return static_cast<uint16_t>(s / 4); });
  return mean;
}

}  // namespace simsense::reference
