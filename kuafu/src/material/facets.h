// SPDX-License-Identifier: Apache-2.0
// GGX facets as quadratures of directional albedos take them. Thread rule: pure functions.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>

namespace kuafu {

// Walter et al. 2007, eq. 34, times 2 cos: G1 = 2 cos / (cos + root).
inline double smith_root(double cosine, double a2) { return std::sqrt(a2 + (1 - a2) * cosine * cosine); }

// Dupuy and Benyoub 2023: visible normals from a cap of the sphere. w: wo, stretched to the hemisphere of roughness 1; `turn`: (cos, sin)
// of the cap's longitude; v: 0..1 over its heights.
inline glm::dvec3 visible_normal(const glm::dvec3& w, double alpha, const glm::dvec2& turn, double v) {
  const double z = (1 - v) * (1 + w.z) - w.z, s = std::sqrt(std::max(1 - z * z, 0.0));
  const glm::dvec3 h = glm::dvec3(s * turn.x, s * turn.y, z) + w;
  return glm::normalize(glm::dvec3(h.x * alpha, h.y * alpha, std::max(h.z, 1e-12)));
}

}  // namespace kuafu
