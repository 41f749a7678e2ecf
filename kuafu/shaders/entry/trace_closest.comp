// SPDX-License-Identifier: Apache-2.0
#version 460
// Nearest hit of each ray of a queue; a miss leaves the ray as it was.
#extension GL_GOOGLE_include_directive : require
#include "lib/bvh_queue.glsl"

uint cutout_kind() { return cutout_closest; }

void begin(uint i) { bvh_begin(queue_world(), queue_root(i), queue_ray(i, closest_words)); }

bool any_hit() { return false; }

bool answer(uint i) {
  if (!bvh_found) return false;
  queue_store(i, ray_t_far, closest_words, floatBitsToUint(bvh_ray.t_far));
  queue_store(i, hit_u, closest_words, floatBitsToUint(bvh_hit.uv.x));
  queue_store(i, hit_v, closest_words, floatBitsToUint(bvh_hit.uv.y));
  queue_store(i, hit_primitive, closest_words, bvh_hit.primitive);
  queue_store(i, hit_geometry, closest_words, 0u);
  queue_store(i, hit_instance, closest_words, bvh_hit.instance);
  return false;
}

#include "entry/bvh_main.glsl"
