// SPDX-License-Identifier: Apache-2.0
// Rigid motion at constant velocity, of a camera, a light or an instance while the shutter is open. Thread rule: pure functions.
#pragma once

#include <glm/glm.hpp>

#include "shared/motion_record.h"

namespace kuafu {

/// Velocities in the object's frame, m/s and rad/s: pose(t) = pose exp(t [linear, angular]).
struct Twist {
  glm::dvec3 linear{0.0}, angular{0.0};
  [[nodiscard]] bool moves() const { return linear != glm::dvec3(0.0) || angular != glm::dvec3(0.0); }
  bool operator==(const Twist&) const = default;
};

/// A motion in world coordinates: x moves to pivot + R(angular t) (x - pivot) + path(t). The pivot's velocity is `linear` at t = 0 and
/// turns with the object (a helix).
struct Motion {
  glm::dvec3 pivot{0.0}, linear{0.0}, angular{0.0};
  [[nodiscard]] glm::dmat4 at(double seconds) const;
  /// An upper bound of the speed of points within radius_m of the pivot, m/s.
  [[nodiscard]] double speed(double radius_m) const;
  bool operator==(const Motion&) const = default;
};

/// Returns the world motion of an object with this pose. Rotation: the pose's polar factor if it scales. Pivot: its origin.
Motion world_motion(const glm::dmat4& pose, const Twist& twist);

/// The time in which a launch's shutters are open, s; 0 is mid-exposure of the middle line.
struct TimeSpan {
  double from_s = 0.0, until_s = 0.0;
  [[nodiscard]] bool instant() const { return from_s == until_s; }
  bool operator==(const TimeSpan&) const = default;
};

/// Returns a motion as shaders and tracers on the device read it.
inline MotionRecord motion_record(const Motion& m) {
  const bool moves = m.linear != glm::dvec3(0.0) || m.angular != glm::dvec3(0.0);
  return {glm::vec3(m.pivot), glm::vec3(m.linear), glm::vec3(m.angular), moves ? 1u : 0u};
}
inline MotionRecord motion_record(const glm::dmat4& pose, const Twist& velocity) {
  return velocity.moves() ? motion_record(world_motion(pose, velocity)) : MotionRecord{};
}

}  // namespace kuafu
