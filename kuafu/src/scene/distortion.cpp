// SPDX-License-Identifier: Apache-2.0
#include "scene/distortion.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "ks/lens.hpp"
#include "shared/lens_record.h"

namespace kuafu {
namespace {

ks_lens lens_of(const Distortion& distortion) {
  ks_lens out{distortion.model, 0, {}};
  std::ranges::copy(distortion.k, out.distortion);
  return out;
}

/// Distorted radius up to which the lens grows in this direction.
double reach(const ks_lens& lens, const glm::dvec2& direction, double most) {
  constexpr int steps = 4096;
  double farthest = 0.0;
  for (int i = 0; i <= steps; ++i) {
    const glm::dvec2 ray = direction * (4.0 * most * i / steps);
    const ks::LensImage seen = ks::distorted(lens, ray.x, ray.y);
    if (!seen.grows()) break;
    farthest = std::hypot(seen.x, seen.y);
  }
  return farthest;
}

bool reachable(const ks_lens& lens, const glm::dvec2& distorted) {
  constexpr int steps = 16, newton = undistort_steps + 1;  // as many as the stages take, and one that doubles the digits
  constexpr double everywhere = std::numeric_limits<double>::infinity();
  ks::LensRay ray{};
  for (int i = 1; i <= steps; ++i) {
    ray = ks::undistorted(lens, distorted.x * i / steps, distorted.y * i / steps, everywhere, newton);
    if (!ray.exists) return false;
  }
  for (int i = 0; i <= 2 * steps; ++i)
    if (!ks::distorted(lens, ray.x * i / (2.0 * steps), ray.y * i / (2.0 * steps)).grows()) return false;
  return true;
}

}  // namespace

glm::dvec2 distort(const Distortion& lens, const glm::dvec2& ideal) {
  const ks::LensImage seen = ks::distorted(lens_of(lens), ideal.x, ideal.y);
  return {seen.x, seen.y};
}

std::optional<Fold> find_fold(const Distortion& distortion, const glm::dmat3& camera_k, uint32_t width, uint32_t height) {
  constexpr int per_side = 16;
  const ks_lens lens = lens_of(distortion);
  const glm::dmat3 to_image = glm::inverse(camera_k);
  for (int i = 0; i < 4 * per_side; ++i) {
    const double along = double(i % per_side) / per_side;
    const int side = i / per_side;  // top, right, bottom, left
    const glm::dvec2 corner[5] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 0}};
    const glm::dvec2 pixel = glm::mix(corner[side], corner[side + 1], along) * glm::dvec2(width, height) - 0.5;
    const glm::dvec2 distorted(to_image * glm::dvec3(pixel, 1.0));
    if (reachable(lens, distorted)) continue;
    const double needed = glm::length(distorted);
    return Fold{pixel, reach(lens, distorted / needed, needed), needed};
  }
  return std::nullopt;
}

}  // namespace kuafu
