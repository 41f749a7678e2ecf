// SPDX-License-Identifier: Apache-2.0
// What the two ray generation shaders share: a ray of the queue sent through its environment's top level.
#ifndef KUAFU_RT_QUEUE_GLSL
#define KUAFU_RT_QUEUE_GLSL

#include "lib/rt_push.glsl"
#include "lib/rt_hit.glsl"
#include "lib/trace_queue.glsl"

layout(location = 0) rayPayloadEXT RtHit hit;

/// This invocation's ray, or one past every queue; the launch may be two-dimensional.
uint queue_ray_index() { return gl_LaunchIDEXT.y * gl_LaunchSizeEXT.x + gl_LaunchIDEXT.x; }

/// Every hit counts, or each is asked whether it does.
uint opacity_flag() { return uvec2(push.scene) != uvec2(0u) ? gl_RayFlagsNoOpaqueEXT : gl_RayFlagsOpaqueEXT; }

/// false: nothing there to be hit, or an interval that Vulkan does not allow. Else `hit` has the answer.
bool queue_trace(uint i, uint words, uint flags) {
  uint environment = queue_environment(i);
  if (environment >= push.environment_count) return false;
  uvec2 top_level = push.top_levels.address[environment];
  float t_near = queue_float(i, ray_t_near, words), t_far = queue_float(i, ray_t_far, words);
  if (top_level == uvec2(0u) || !(t_near <= t_far)) return false;
  traceRayEXT(accelerationStructureEXT(top_level), flags, 0xffu, 0u, 0u, 0u, queue_vec3(i, ray_origin, words), t_near,
              queue_vec3(i, ray_direction, words), t_far, 0);
  return true;
}

#endif
