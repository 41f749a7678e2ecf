// What the compute entries that trace share: their push constants, and a ray read from its queue (shared/ray_queue.h).
#ifndef KUAFU_BVH_QUEUE_GLSL
#define KUAFU_BVH_QUEUE_GLSL

#include "lib/queue_words.glsl"
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
  uint capacity;
  uint environment_count;
  uint has_environments;
#ifdef KUAFU_MORE_PUSH
  KUAFU_MORE_PUSH
#endif
} push;

#include "lib/trace_queue.glsl"

/// This invocation's ray, or one past every queue; the grid may be two-dimensional.
uint queue_ray_index() { return (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationID.x; }

/// Where a ray starts; bvh_done for rays of environments that there are not.
uint queue_root(uint i) {
  uint environment = queue_environment(i);
  return environment < push.environment_count ? push.roots.word[environment] : bvh_done;
}

BvhRay queue_ray(uint i, uint words) {
  return BvhRay(queue_vec3(i, ray_origin, words), queue_float(i, ray_t_near, words), queue_vec3(i, ray_direction, words),
                queue_float(i, ray_t_far, words), rays_have_time ? queue_float(i, ray_time, words) : 0.0);
}

#endif
