// SPDX-License-Identifier: Apache-2.0
// Lens distortion (ks/lens.h) in double: whether an image can be undistorted. The stages do the same in shaders/lib/distortion.glsl.
// Thread rule: pure functions.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <optional>

namespace kuafu {

struct Distortion {
  uint32_t model = 0;  // lens_*
  std::array<double, 8> k{};
  bool operator==(const Distortion&) const = default;
};

inline bool distorts(const Distortion& lens) { return lens != Distortion{}; }

/// Returns the distorted position of the ray through `ideal` (x/z, y/z).
glm::dvec2 distort(const Distortion& lens, const glm::dvec2& ideal);

struct Fold {
  glm::dvec2 pixel;        // of the image's edge that cannot be reached
  double reached, needed;  // distorted radius where the lens stops growing, and of the pixel, in focal lengths
};
/// Returns the first pixel on the image's edge with no ray or several; nothing if the whole image can be undistorted.
std::optional<Fold> find_fold(const Distortion& lens, const glm::dmat3& camera_k, uint32_t width, uint32_t height);

}  // namespace kuafu
