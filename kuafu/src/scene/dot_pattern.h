// SPDX-License-Identifier: Apache-2.0
// A projector's pattern as a list of Gaussian dots, and its image. Thread rule: pure functions.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <string>
#include <vector>

namespace kuafu {

struct Texture;

struct DotPattern {
  std::vector<glm::vec3> dots;  // u, v in pixels of the raster, and power: the pattern's integral over the dot, pixels squared
  uint32_t width = 0, height = 0;
  float sigma_px = 0.0f;
  double background = 0.0;  // of every pixel
  bool operator==(const DotPattern&) const = default;
};

/// Throws for a pattern that cannot be drawn; `light` names its owner.
void check(const DotPattern& pattern, const std::string& light);

/// Draws the pattern as one channel of float32. Each pixel holds the integral of the dots over its square, so a dot keeps its power
/// anywhere on the grid.
Texture rasterise(const DotPattern& pattern);

}  // namespace kuafu
