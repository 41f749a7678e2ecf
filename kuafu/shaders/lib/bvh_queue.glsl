// SPDX-License-Identifier: Apache-2.0
// What the compute entries that trace share: their push constants, and a ray read from its queue (shared/ray_queue.h).
#ifndef KUAFU_BVH_QUEUE_GLSL
#define KUAFU_BVH_QUEUE_GLSL

#include "lib/queue_words.glsl"
#include "shared/wave.h"

layout(constant_id = 3) const uint features = 0u;

// After the extensions that it needs.
#include "lib/bvh.glsl"

layout(local_size_x_id = 0) in;

layout(push_constant, scalar) uniform Push {
  QueueWords words;
  QueueWords environments;  // null unless has_environments
  QueueWords count;
  QueueWords roots;         // child code of each environment's top level
  BvhNodes nodes;
  BvhInstances instances;
  MotionArray motions;      // as instances; null where none moves
  SceneReference scene;     // null unless feature_cutouts, or for shadow rays through glass
  uint capacity;
  uint environment_count;
  uint has_environments;
  uint surfaces;            // of glass that a shadow ray may pass
#ifdef KUAFU_MORE_PUSH
  KUAFU_MORE_PUSH
#endif
} push;

#include "lib/cutout.glsl"
#include "lib/trace_queue.glsl"

/// What kind of ray this is (cutout_*); the entry says it.
uint cutout_kind();
bool bvh_stands_at(uint instance, uint primitive, vec2 uv) { return stands_at(push.scene.at[0], instance, primitive, uv.x, uv.y, cutout_kind()); }

layout(constant_id = 4) const uint spread_groups = 0u;  // Tracer::spread_groups

const uint no_ray = 0xffffffffu;

/// This invocation's ray, or one past every queue; the grid may be two-dimensional.
/// A group waits for the longest way that any of its rays takes, and longer where they diverge. So the rays of a queue that would not fill the device
/// are spread: over so many groups that each has as few as there can be.
uint queue_ray_index() {
  uint rays = gl_WorkGroupSize.x;
  if (spread_groups > 0u) rays = clamp((queue_ray_count() + spread_groups - 1u) / spread_groups, 1u, rays);
  if (gl_LocalInvocationID.x >= rays) return no_ray;
  return (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * rays + gl_LocalInvocationID.x;
}

/// Where a ray starts; bvh_done for rays of environments that there are not.
uint queue_root(uint i) {
  uint environment = queue_environment(i);
  return environment < push.environment_count ? push.roots.word[environment] : bvh_done;
}

BvhRay queue_ray(uint i, uint words) {
  return BvhRay(queue_vec3(i, ray_origin, words), queue_float(i, ray_t_near, words), queue_vec3(i, ray_direction, words),
                queue_float(i, ray_t_far, words), rays_have_time ? queue_float(i, ray_time, words) : 0.0);
}

BvhWorld queue_world() { return BvhWorld(push.nodes, push.instances, push.motions); }

#endif
