// SPDX-License-Identifier: Apache-2.0
#include "cpu/checks/checks.h"

#include <algorithm>
#include <cmath>

namespace simsense {

void EdgeCheck::apply(const EdgeParameters& p, const MatchMaps& maps, uint32_t width, uint32_t height, float invalid,
                      ks::ThreadPool& workers) {
  before_.assign(maps.disparity, maps.disparity + size_t{width} * height);
  const float first = static_cast<float>(p.border_px), last = static_cast<float>(width) - 1 - first;
  const auto is_at_border = [&](uint32_t x, float d) {
    const float match = static_cast<float>(x) - d;
    return p.border_px > 0 && (match < first || match > last);
  };
  const auto is_at_step = [&](uint32_t x, uint32_t y, float d) {
    if (!(p.step_px > 0)) return false;
    for (uint32_t v = y - std::min(y, 1u); v <= std::min(height - 1, y + 1); ++v)
      for (uint32_t u = x - std::min(x, 1u); u <= std::min(width - 1, x + 1); ++u) {
        const float other = before_[size_t{v} * width + u];
        if (other != invalid && std::abs(other - d) > p.step_px) return true;
      }
    return false;
  };
  workers.parallel_for(height, [&](size_t row) {
    const auto y = static_cast<uint32_t>(row);
    for (uint32_t x = 0; x < width; ++x) {
      const size_t at = size_t{y} * width + x;
      const float d = before_[at];
      if (d == invalid) continue;
      const bool is_outside = is_at_border(x, d);
      if (!is_outside && !is_at_step(x, y, d)) continue;
      maps.reject(at, invalid, is_outside ? MatchReason::outside : MatchReason::not_unique);
    }
  });
}

}  // namespace simsense
