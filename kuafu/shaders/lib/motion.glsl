// SPDX-License-Identifier: Apache-2.0
// Points and directions of something that moves at constant velocity (shared/motion_record.h).
#ifndef KUAFU_MOTION_GLSL
#define KUAFU_MOTION_GLSL
#include "lib/language.glsl"
#include "shared/motion_record.h"

// sin(a)/a, (1 - cos a)/a^2 and (a - sin a)/a^3 of a^2; series where they would cancel.
vec3 turn_weights(float a2) {
  if (a2 < 0.25f)
    return vec3(1.0f - a2 * (1.0f / 6.0f - a2 * (1.0f / 120.0f - a2 / 5040.0f)), 0.5f - a2 * (1.0f / 24.0f - a2 * (1.0f / 720.0f - a2 / 40320.0f)),
                1.0f / 6.0f - a2 * (1.0f / 120.0f - a2 * (1.0f / 5040.0f - a2 / 362880.0f)));
  float a = sqrt(a2), sine = sin(a) / a;
  return vec3(sine, (1.0f - cos(a)) / a2, (1.0f - sine) / a2);
}

/// v turned by the rotation vector `angle` (Rodrigues).
vec3 turn(vec3 angle, vec3 v) {
  vec3 w = turn_weights(dot(angle, angle)), c = cross(angle, v);
  return v + w.x * c + w.y * cross(angle, c);
}

/// How far the pivot has gone.
vec3 path_at(IN(MotionRecord) m, float seconds) {
  vec3 angle = m.angular * seconds, way = m.linear * seconds, w = turn_weights(dot(angle, angle)), c = cross(angle, way);
  return way + w.y * c + w.z * cross(angle, c);
}

vec3 moved_direction(IN(MotionRecord) m, float seconds, vec3 v) { return turn(m.angular * seconds, v); }
vec3 moved_point(IN(MotionRecord) m, float seconds, vec3 p) { return m.pivot + path_at(m, seconds) + turn(m.angular * seconds, p - m.pivot); }

/// Back to where it was at t = 0.
vec3 unmoved_direction(IN(MotionRecord) m, float seconds, vec3 v) { return turn(m.angular * -seconds, v); }
vec3 unmoved_point(IN(MotionRecord) m, float seconds, vec3 p) { return m.pivot + turn(m.angular * -seconds, p - m.pivot - path_at(m, seconds)); }
#endif
