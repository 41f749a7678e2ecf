// SPDX-License-Identifier: Apache-2.0
// Reading and filling ray queues (shared/ray_queue.h). `queue_layout` is the includer's.
#ifndef KUAFU_QUEUE_GLSL
#define KUAFU_QUEUE_GLSL
#include "lib/language.glsl"
#include "shared/wave.h"

struct Ray {
  vec3 origin;
  float t_near;
  vec3 direction;
  float t_far;
};

/// Of what asks for none.
Ray empty_ray() { return Ray(vec3(0.0f), 0.0f, vec3(0.0f, 0.0f, 1.0f), 0.0f); }

uint closest_word(uint i, uint field, uint capacity) { return ray_word(i, field, closest_words, queue_layout, capacity); }
uint occlusion_word(uint i, uint field, uint capacity) { return ray_word(i, field, occlusion_words, queue_layout, capacity); }

vec3 load_direction(UintArray words, uint i, uint capacity) {
  return vec3(uintBitsToFloat(words.at[closest_word(i, ray_direction, capacity)]),
              uintBitsToFloat(words.at[closest_word(i, ray_direction + 1u, capacity)]),
              uintBitsToFloat(words.at[closest_word(i, ray_direction + 2u, capacity)]));
}

void store_float(UintArray words, uint i, uint field, uint stride, uint capacity, float value) {
  words.at[ray_word(i, field, stride, queue_layout, capacity)] = floatBitsToUint(value);
}

void store_ray(UintArray words, uint i, uint stride, uint capacity, IN(Ray) ray, float time_s, uint slot) {
  store_float(words, i, ray_origin, stride, capacity, ray.origin.x);
  store_float(words, i, ray_origin + 1u, stride, capacity, ray.origin.y);
  store_float(words, i, ray_origin + 2u, stride, capacity, ray.origin.z);
  store_float(words, i, ray_t_near, stride, capacity, ray.t_near);
  store_float(words, i, ray_direction, stride, capacity, ray.direction.x);
  store_float(words, i, ray_direction + 1u, stride, capacity, ray.direction.y);
  store_float(words, i, ray_direction + 2u, stride, capacity, ray.direction.z);
  store_float(words, i, ray_time, stride, capacity, time_s);
  store_float(words, i, ray_t_far, stride, capacity, ray.t_far);
  words.at[ray_word(i, ray_id, stride, queue_layout, capacity)] = slot;
  if (queue_layout != queue_layout_packets) return;
  words.at[ray_word(i, ray_mask, stride, queue_layout, capacity)] = 0xffffffffu;
  words.at[ray_word(i, ray_flags, stride, queue_layout, capacity)] = 0u;
}

void store_closest_ray(UintArray words, uint i, uint capacity, IN(Ray) ray, float time_s, uint slot) {
  store_ray(words, i, closest_words, capacity, ray, time_s, slot);
  words.at[closest_word(i, hit_geometry, capacity)] = miss;
  if (queue_layout == queue_layout_packets) words.at[closest_word(i, hit_instance, capacity)] = miss;
}
#endif
