// Reading and filling ray queues (shared/ray_queue.h).
#ifndef KUAFU_QUEUE_GLSL
#define KUAFU_QUEUE_GLSL
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require

#include "shared/wave.h"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint queue_layout = queue_layout_planes;
layout(constant_id = 2) const uint trace_group_size = 32u;

vec3 load_vec3(UintArray words, uint i, uint field, uint stride, uint capacity) {
  return uintBitsToFloat(uvec3(words.at[ray_word(i, field, stride, queue_layout, capacity)],
                               words.at[ray_word(i, field + 1u, stride, queue_layout, capacity)],
                               words.at[ray_word(i, field + 2u, stride, queue_layout, capacity)]));
}

void store_ray(UintArray words, uint i, uint stride, uint capacity, vec3 origin, float t_near, vec3 direction, float t_far, uint slot) {
  uint values[12] = uint[12](floatBitsToUint(origin.x), floatBitsToUint(origin.y), floatBitsToUint(origin.z), floatBitsToUint(t_near),
                             floatBitsToUint(direction.x), floatBitsToUint(direction.y), floatBitsToUint(direction.z), 0u,
                             floatBitsToUint(t_far), 0xffffffffu, slot, 0u);
  for (uint f = 0u; f < 12u; ++f) words.at[ray_word(i, f, stride, queue_layout, capacity)] = values[f];
}

void store_closest_ray(UintArray words, uint i, uint capacity, vec3 origin, float t_near, vec3 direction, float t_far, uint slot) {
  store_ray(words, i, closest_words, capacity, origin, t_near, direction, t_far, slot);
  words.at[ray_word(i, hit_geometry, closest_words, queue_layout, capacity)] = miss;
  words.at[ray_word(i, hit_instance, closest_words, queue_layout, capacity)] = miss;
}

void store_arguments(UintArray counters, uint word, uint group_count_x) {
  atomicMax(counters.at[word], group_count_x);
  counters.at[word + 1u] = 1u;
  counters.at[word + 2u] = 1u;
}

/// Reserves a place for each invocation that wants one, with one atomic per subgroup. Call in uniform control flow.
uint append(bool wanted, UintArray counters, uint count_word, out uint end) {
  uvec4 ballot = subgroupBallot(wanted);
  uint count = subgroupBallotBitCount(ballot);
  uint base = 0u;
  if (subgroupElect() && count > 0u) base = atomicAdd(counters.at[count_word], count);
  base = subgroupBroadcastFirst(base);
  end = count > 0u ? base + count : 0u;
  return base + subgroupBallotExclusiveBitCount(ballot);
}
#endif
