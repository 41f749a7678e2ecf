// SPDX-License-Identifier: Apache-2.0
#include "accel/swept_box.h"

#include <algorithm>
#include <cmath>

#include "accel/top_level.h"
#include "scene/box_corners.h"

namespace kuafu {
namespace {

double farthest_corner_m(const Box& local, const glm::dmat4& local_to_world, const glm::dvec3& from) {
  double farthest = 0.0;
  for (const glm::dvec3& corner : box_corners(local))
    farthest = std::max(farthest, glm::length(glm::dvec3(local_to_world * glm::dvec4(corner, 1.0)) - from));
  return farthest;
}

/// World box of all places that a box sweeps: boxes at steps, and what a point's arc may leave its chord between them.
Box swept_box(const Box& local, const Placement& placement) {
  constexpr double radians_per_step = 0.1;
  const Sweep& sweep = *placement.sweep;
  const double seconds = sweep.span.until_s - sweep.span.from_s, rate = glm::length(sweep.motion.angular);
  const int steps = int(std::clamp(std::ceil(rate * seconds / radians_per_step), 1.0, 256.0));
  Box box;
  for (int i = 0; i <= steps; ++i) {
    const double t = glm::mix(sweep.span.from_s, sweep.span.until_s, double(i) / steps);
    box.add(world_box(local, sweep.motion.at(t) * placement.local_to_world));
  }
  const double speed = glm::length(sweep.motion.linear) + rate * farthest_corner_m(local, placement.local_to_world, sweep.motion.pivot);
  const double step_s = seconds / steps,
               sag = step_s * step_s / 8 * rate * speed;  // acceleration of a screw's points is at most rate * speed
  // Rays are taken back in float: its rounding too.
  const glm::vec3 size = glm::max(glm::abs(box.min), glm::abs(box.max));
  const float grow = float(sag) + 1e-6f * std::max({size.x, size.y, size.z});
  box.min -= grow, box.max += grow;
  return box;
}

}  // namespace

Box placement_box(const Box& local, const Placement& placement) {
  return placement.sweep ? swept_box(local, placement) : world_box(local, placement.local_to_world);
}

}  // namespace kuafu
