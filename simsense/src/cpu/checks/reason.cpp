// SPDX-License-Identifier: Apache-2.0
#include "cpu/checks/checks.h"

#include <algorithm>

namespace simsense {

void find_reasons(const ReasonParameters& p, ConstImage left, uint32_t width, uint32_t height, MatchReason* reason,
                  ks::ThreadPool& workers) {
  const auto half_width = static_cast<ptrdiff_t>(p.window_width / 2), half_height = static_cast<ptrdiff_t>(p.window_height / 2);
  const auto last_x = static_cast<ptrdiff_t>(width) - 1, last_y = static_cast<ptrdiff_t>(height) - 1;
  workers.parallel_for(height, [&](size_t row) {
    const auto y = static_cast<ptrdiff_t>(row);
    for (ptrdiff_t x = 0; x <= last_x; ++x) {
      MatchReason& why = reason[row * width + static_cast<size_t>(x)];
      if (!MAY_BE_EXPLAINED(static_cast<uint32_t>(why))) continue;
      uint32_t darkest = UINT32_MAX, brightest = 0, saturated = 0, cells = 0;
      for (ptrdiff_t v = std::max<ptrdiff_t>(0, y - half_height); v <= std::min(last_y, y + half_height); ++v) {
        for (ptrdiff_t u = std::max<ptrdiff_t>(0, x - half_width); u <= std::min(last_x, x + half_width); ++u) {
          const uint32_t value = left.at(u, v);
          darkest = std::min(darkest, value);
          brightest = std::max(brightest, value);
          saturated += value >= p.saturated_dn;
          ++cells;
        }
      }
      if (2 * saturated >= cells) {
        why = MatchReason::saturated;
      } else if (brightest - darkest <= p.low_texture_dn) {
        why = MatchReason::low_texture;
      }
    }
  });
}

}  // namespace simsense
