// SPDX-License-Identifier: Apache-2.0
// The lights that glass bends by beams: those without extent. Thread rule: pure functions.
#pragma once

#include <vector>

#include "light/light_table.h"

namespace kuafu {

/// A light without extent, in one environment.
struct SharpLight {
  uint32_t index, environment;  // of LightTable
  bool directional;
  glm::vec3 position;   // of one that is not directional
  glm::vec3 direction;  // of a directional one's light, unit
};

std::vector<SharpLight> sharp_lights(const LightTable& table);

}  // namespace kuafu
