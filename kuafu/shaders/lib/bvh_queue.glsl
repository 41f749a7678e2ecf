// What the two trace entries share: their push constants, and a ray read from its queue (shared/ray_queue.h).
#ifndef KUAFU_BVH_QUEUE_GLSL
#define KUAFU_BVH_QUEUE_GLSL

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require

#include "lib/bvh.glsl"
#include "shared/ray_queue.h"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint layout_kind = queue_layout_planes;

layout(buffer_reference, scalar, buffer_reference_align = 4) buffer QueueWords { uint word[]; };

layout(push_constant, scalar) uniform Push {
  QueueWords words;
  QueueWords environments;  // null unless has_environments
  QueueWords count;
  QueueWords roots;         // child code of each environment's top level
  BvhNodes nodes;
  BvhInstances instances;
  uint capacity;
  uint environment_count;
  uint has_environments;
} push;

/// This invocation's ray, or one past every queue; the grid may be two-dimensional.
uint queue_ray_index() { return (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationID.x; }

uint queue_ray_count() { return min(push.count.word[0], push.capacity); }

/// Rays of environments that there are not see nothing.
uint queue_root(uint i) {
  uint environment = push.has_environments != 0u ? push.environments.word[i] : 0u;
  return environment < push.environment_count ? push.roots.word[environment] : bvh_done;
}

uint queue_word(uint i, uint field, uint words) { return ray_word(i, field, words, layout_kind, push.capacity); }

float queue_float(uint i, uint field, uint words) { return uintBitsToFloat(push.words.word[queue_word(i, field, words)]); }

vec3 queue_vec3(uint i, uint field, uint words) {
  return vec3(queue_float(i, field, words), queue_float(i, field + 1u, words), queue_float(i, field + 2u, words));
}

BvhRay queue_ray(uint i, uint words) {
  return BvhRay(queue_vec3(i, ray_origin, words), queue_float(i, ray_t_near, words), queue_vec3(i, ray_direction, words),
                queue_float(i, ray_t_far, words));
}

void queue_store(uint i, uint field, uint words, uint value) { push.words.word[queue_word(i, field, words)] = value; }

#endif
