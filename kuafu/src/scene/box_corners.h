// SPDX-License-Identifier: Apache-2.0
// The corners of a box whose sides follow the axes. Thread rule: pure function.
#pragma once

#include <array>
#include <glm/glm.hpp>

namespace kuafu {

/// The eight corners of a box, which is any struct with `min` and `max`.
template <typename Box>
std::array<glm::dvec3, 8> box_corners(const Box& box) {
  std::array<glm::dvec3, 8> corners;
  for (size_t i = 0; i < 8; ++i) corners[i] = {i & 1 ? box.max.x : box.min.x, i & 2 ? box.max.y : box.min.y, i & 4 ? box.max.z : box.min.z};
  return corners;
}

}  // namespace kuafu
