// SPDX-License-Identifier: Apache-2.0
#include "match/matcher.h"

#include <algorithm>
#include <utility>

#include "match/detection.h"

namespace simsense {

Region reach(const Region& r, const MatchParameters& p, uint32_t width, uint32_t height) {
  constexpr int32_t surroundings = 16, smallest = 32;
  const auto half = [](uint32_t census, uint32_t block, uint32_t median) { return static_cast<int32_t>((census + block + median) / 2); };
  const int32_t farthest = std::max(0, p.min_disparity + static_cast<int32_t>(p.max_disparity)), nearest = std::max(0, -p.min_disparity);
  const uint32_t margin = p.census_contrast_256ths > 0 ? 2 * MatchParameters::contrast_margin : 0;
  const uint32_t side = p.detection_side();
  const auto detected = static_cast<int32_t>(p.detects() ? side / 2 + detection_mean_side(side) / 2 + detection_bare_reach(side) + 1 : 0);
  const int32_t refined = (p.refines() ? REFINE_REACH + 2 * REFINE_CELL : 0) + detected;
  const int32_t dx = surroundings + refined + half(p.census_width + margin, p.block_width, p.median_size);
  const int32_t dy = surroundings + refined + half(p.census_height + margin, p.block_height, p.median_size);
  const auto widened = [](uint32_t begin, uint32_t end, int32_t before, int32_t after, uint32_t size) {
    const auto lower = static_cast<uint32_t>(std::max(0, static_cast<int32_t>(begin) - before));
    const auto upper = std::max(std::min(size, end + static_cast<uint32_t>(after)), lower + smallest);
    return std::pair{upper > size ? size - smallest : lower, std::min(size, upper)};
  };
  const auto [x0, x1] = widened(r.x0, r.x1, dx + farthest, dx + nearest, width);
  const auto [y0, y1] = widened(r.y0, r.y1, dy, dy, height);
  return {x0, y0, x1, y1};
}

}  // namespace simsense
