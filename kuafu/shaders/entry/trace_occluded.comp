// SPDX-License-Identifier: Apache-2.0
#version 460
// Any hit of each ray of a queue: t_far becomes minus infinity where something stands in the way.
#extension GL_GOOGLE_include_directive : require
#include "lib/bvh_queue.glsl"

uint cutout_kind() { return cutout_occluded; }

void begin(uint i) { bvh_begin(queue_world(), queue_root(i), queue_ray(i, occlusion_words)); }

bool any_hit() { return true; }

bool answer(uint i) {
  if (bvh_found) queue_store(i, ray_t_far, occlusion_words, 0xff800000u);
  return false;
}

#include "entry/bvh_main.glsl"
