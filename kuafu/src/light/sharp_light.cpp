// SPDX-License-Identifier: Apache-2.0
#include "light/sharp_light.h"

namespace kuafu {

std::vector<SharpLight> sharp_lights(const LightTable& table) {
  std::vector<SharpLight> out;
  for (uint32_t e = 0; e < table.environments.size(); ++e)
    for (uint32_t k = 0; k < table.environments[e].light_count; ++k) {
      const uint32_t index = table.environments[e].first_light + k;
      const LightRecord& light = table.lights[index];
      const LightShape& shape = table.shapes[index];
      const bool directional = light.kind == light_directional && shape.one_minus_cos == 0.0f;
      const bool point = light.kind == light_projector || light.kind == light_spot || (light.kind == light_point && shape.radius_m == 0.0f);
      if (directional || point)
        out.push_back(
            {.index = index, .environment = e, .directional = directional, .position = light.position, .direction = shape.axis_z});
    }
  return out;
}

}  // namespace kuafu
