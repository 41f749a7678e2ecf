// SPDX-License-Identifier: Apache-2.0
#include "material/albedo_tables.h"

#include <algorithm>
#include <iterator>

#include "shared/scene_records.h"

namespace kuafu {

std::vector<glm::vec2> albedo_tables(ks::ThreadPool& workers, bool sheen, bool frosted) {
  std::vector<glm::vec2> all = specular_albedo_table(workers);
  std::ranges::copy(sheen ? sheen_albedo_table(workers) : std::vector<glm::vec2>(sheen_albedo_entries), std::back_inserter(all));
  if (frosted) std::ranges::copy(glass_albedo_table(workers), std::back_inserter(all));
  return all;
}

}  // namespace kuafu
