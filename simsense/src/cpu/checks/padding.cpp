// SPDX-License-Identifier: Apache-2.0
#include "cpu/checks/checks.h"

namespace simsense {

void invalidate_outside(const RemapTable& table, const MatchMaps& maps, float invalid, ks::ThreadPool& workers) {
  const float last_x = static_cast<float>(table.width - 1), last_y = static_cast<float>(table.height - 1);
  workers.parallel_for(table.height, [&](size_t y) {
    for (size_t i = y * table.width; i < (y + 1) * table.width; ++i) {
      if (table.x[i] >= 0 && table.y[i] >= 0 && table.x[i] <= last_x && table.y[i] <= last_y) continue;
      maps.reject(i, invalid, MatchReason::not_computed);
    }
  });
}

}  // namespace simsense
