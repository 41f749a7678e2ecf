// A motion as shaders and tracers on the device read it. Thread rule: pure functions.
#pragma once

#include "scene/motion.h"
#include "shared/motion_record.h"

namespace kuafu {

inline MotionRecord motion_record(const Motion& m) {
  const bool moves = m.linear != glm::dvec3(0.0) || m.angular != glm::dvec3(0.0);
  return {glm::vec3(m.pivot), glm::vec3(m.linear), glm::vec3(m.angular), moves ? 1u : 0u};
}
inline MotionRecord motion_record(const glm::dmat4& pose, const Twist& velocity) {
  return velocity.moves() ? motion_record(world_motion(pose, velocity)) : MotionRecord{};
}

}  // namespace kuafu
