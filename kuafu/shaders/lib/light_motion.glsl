// SPDX-License-Identifier: Apache-2.0
// Lights at the time of a ray. One that moves is asked in its place at t = 0, to which the point that asks is taken back.
#ifndef KUAFU_LIGHT_MOTION_GLSL
#define KUAFU_LIGHT_MOTION_GLSL
#include "lib/light_shape.glsl"
#include "lib/motion.glsl"

bool is_lit(IN(LightMotion) m, float time_s) { return m.on_from_s == m.on_until_s || (time_s >= m.on_from_s && time_s < m.on_until_s); }

/// sample_light, or light_at where no light has a shape, at a time.
LightSample light_towards(IN(SceneAddresses) scene, uint index, vec3 position, vec2 u, float time_s) {
  IN(LightRecord) light = scene.lights.at[index];
  LightMotion m;
  m.motion.pivot = m.motion.linear = m.motion.angular = vec3(0.0f);
  bool moves = false;
  if ((features & feature_motion) != 0u && scene.moves != 0u) {
    m = scene.light_motions.at[index];
    moves = m.motion.moves != 0u;
    if (moves) position = unmoved_point(m.motion, time_s, position);
  }
  LightSample l;
  if ((features & feature_lights) != 0u) l = sample_light(scene, light, scene.light_shapes.at[index], position, u, time_s);
  else l = light_at(light, position);
  if (moves) l.direction = moved_direction(m.motion, time_s, l.direction);
  if ((features & feature_motion) != 0u && scene.moves != 0u && !is_lit(m, time_s)) l.irradiance = Spectrum(0.0f);
  return l;
}

/// meet_light at a time.
ShapeHit meet_moving_light(IN(SceneAddresses) scene, uint index, vec3 origin, vec3 direction, float time_s) {
  if ((features & feature_motion) != 0u && scene.moves != 0u) {
    IN(MotionRecord) m = scene.light_motions.at[index].motion;
    if (m.moves != 0u) {
      origin = unmoved_point(m, time_s, origin);
      direction = unmoved_direction(m, time_s, direction);
    }
  }
  return meet_light(scene, scene.lights.at[index], scene.light_shapes.at[index], origin, direction);
}
#endif
