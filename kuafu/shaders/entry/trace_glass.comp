// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Built once for each band (KUAFU_CHANNELS): a shadow ray's whole way through smooth surfaces, in one go; stage `transmit` does the same queue by queue.
// t_far becomes minus infinity where something stands in the way; else the contribution is dimmed.
#include "shared/wave.h"
// What stage/glass.glsl reads, beyond what every tracer is given.
#define KUAFU_MORE_PUSH FloatArray contributions; uint has_medium, unused;
#include "lib/bvh_queue.glsl"

#include "lib/shading.glsl"
#include "stage/glass.glsl"

// The ray on its way past surfaces, in pieces: how many it has passed, what is left of its light, and whether glass stops it all the same.
Ray glass_ray;
uint glass_passed;
Spectrum glass_light;
bool glass_opaque;
bool glass_bent;  // and that of bodies anyway

uint cutout_kind() { return cutout_occluded; }

uint contribution_word(uint c, uint i) { return c * push.capacity + i; }

void begin(uint i) {
  BvhRay ray = queue_ray(i, occlusion_words);
  glass_ray = Ray(ray.origin, ray.t_near, ray.direction, ray.t_far);
  glass_passed = 0u;
  uint id = push.words.word[queue_word(i, ray_id, occlusion_words)];
  glass_opaque = (id & shadow_opaque) != 0u;
  glass_bent = (id & shadow_bent) != 0u;
#if KUAFU_CHANNELS == 1
  glass_light = push.contributions.at[i];
#else
  glass_light = vec3(push.contributions.at[i], push.contributions.at[contribution_word(1u, i)], push.contributions.at[contribution_word(2u, i)]);
#endif
  bvh_begin(queue_world(), queue_root(i), ray);
}

/// Nothing is passed from here on.
bool any_hit() { return glass_opaque || glass_passed >= push.surfaces; }

bool blocked(uint i) {
  queue_store(i, ray_t_far, occlusion_words, 0xff800000u);
  return false;
}

bool passed_all(uint i) {
  if (glass_passed > 0u)
    for (uint c = 0u; c < channels; ++c) push.contributions.at[contribution_word(c, i)] = channel_of(glass_light, c);
  return false;
}

bool answer(uint i) {
  if (!bvh_found) return passed_all(i);
  if (any_hit()) return blocked(i);
  MetSurface met = MetSurface(bvh_hit.instance, bvh_hit.primitive, bvh_hit.uv.x, bvh_hit.uv.y, bvh_ray.t_far);
  glass_light *= pass_surface(met, bvh_ray.time_s, glass_bent, glass_ray);
  if (max_component(glass_light) == 0.0) return blocked(i);
  ++glass_passed;
  glass_ray.t_near = 0.0;
  glass_ray.t_far -= met.t;
  if (glass_ray.t_far <= 0.0) return passed_all(i);
  bvh_begin(queue_world(), queue_root(i), BvhRay(glass_ray.origin, glass_ray.t_near, glass_ray.direction, glass_ray.t_far, bvh_ray.time_s));
  return true;
}

#include "entry/bvh_main.glsl"
