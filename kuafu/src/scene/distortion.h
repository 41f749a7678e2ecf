// SPDX-License-Identifier: Apache-2.0
// Brown and Conrady's lens distortion, rational (k1 k2 p1 p2 k3 k4 k5 k6, OpenCV's order), in double: whether an image can be undistorted.
// The stages do the same in shaders/lib/distortion.glsl. Thread rule: pure functions.
#pragma once

#include <array>
#include <glm/glm.hpp>
#include <optional>

namespace kuafu {

using Distortion = std::array<double, 8>;

inline bool distorts(const Distortion& k) { return k != Distortion{}; }

/// Where the ray through `ideal` (x/z, y/z) appears.
glm::dvec2 distort(const Distortion& k, const glm::dvec2& ideal);

struct Fold {
  glm::dvec2 pixel;        // of the image's edge that cannot be reached
  double reached, needed;  // distorted radius (tangent of the angle from the axis) where the lens stops growing, and of the pixel
};
/// The first pixel of the image's edge that has no ray, or more than one; nothing when the whole image can be undistorted.
std::optional<Fold> find_fold(const Distortion& k, const glm::dmat3& camera_k, uint32_t width, uint32_t height);

}  // namespace kuafu
