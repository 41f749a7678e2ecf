// SPDX-License-Identifier: Apache-2.0
// Reading and answering the rays of a queue (shared/ray_queue.h). Included after a push block that has the members
// words, environments, count, capacity, environment_count and has_environments.
#ifndef KUAFU_TRACE_QUEUE_GLSL
#define KUAFU_TRACE_QUEUE_GLSL

uint queue_ray_count() { return min(push.count.word[0], push.capacity); }

/// environment_count for a ray of an environment that there is not: it sees nothing.
uint queue_environment(uint i) {
  uint environment = push.has_environments != 0u ? push.environments.word[i] : 0u;
  return min(environment, push.environment_count);
}

uint queue_word(uint i, uint field, uint words) { return ray_word(i, field, words, queue_layout, push.capacity); }

float queue_float(uint i, uint field, uint words) { return uintBitsToFloat(push.words.word[queue_word(i, field, words)]); }

vec3 queue_vec3(uint i, uint field, uint words) {
  return vec3(queue_float(i, field, words), queue_float(i, field + 1u, words), queue_float(i, field + 2u, words));
}

void queue_store(uint i, uint field, uint words, uint value) { push.words.word[queue_word(i, field, words)] = value; }

#endif
