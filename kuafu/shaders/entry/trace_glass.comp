// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Built once for each band (KUAFU_CHANNELS): a shadow ray's whole way through smooth surfaces, in one go; stage `transmit` does the same queue by queue.
// t_far becomes minus infinity where something stands in the way; else the contribution is dimmed.
#include "shared/wave.h"
// What stage/glass.glsl reads, beyond what every tracer is given.
#define KUAFU_MORE_PUSH FloatArray contributions; FloatArray bends; uint has_medium, unused;
#include "lib/bvh_queue.glsl"

layout(constant_id = 5) const uint bends_light_ways = 0u;
#include "lib/shading.glsl"
#include "stage/glass.glsl"
#include "stage/bend.glsl"

// The ray on its way past surfaces, in pieces: how many it has passed, what is left of its light, and whether glass stops it all the same.
Ray glass_ray;
uint glass_passed;
Spectrum glass_light;
bool glass_opaque;
Bend glass_bend;
bool glass_bends;

uint cutout_kind() { return glass_bends ? cutout_search : cutout_occluded; }

uint contribution_word(uint c, uint i) { return c * push.capacity + i; }

void begin(uint i) {
  BvhRay ray = queue_ray(i, occlusion_words);
  glass_ray = Ray(ray.origin, ray.t_near, ray.direction, ray.t_far);
  glass_passed = 0u;
  uint id = push.words.word[queue_word(i, ray_id, occlusion_words)];
  glass_opaque = (id & shadow_opaque) != 0u;
  glass_bends = bends_light_ways != 0u && (id & shadow_bends) != 0u;
#if KUAFU_CHANNELS == 1
  glass_light = push.contributions.at[i];
#else
  glass_light = vec3(push.contributions.at[i], push.contributions.at[contribution_word(1u, i)], push.contributions.at[contribution_word(2u, i)]);
#endif
  bvh_begin(queue_world(), queue_root(i), ray);
}

/// Nothing is passed from here on.
bool any_hit() { return glass_opaque || (!glass_bends && glass_passed >= push.surfaces); }

bool blocked(uint i) {
  queue_store(i, ray_t_far, occlusion_words, 0xff800000u);
  return false;
}

bool passed_all(uint i) {
  if (glass_passed > 0u)
    for (uint c = 0u; c < channels; ++c) push.contributions.at[contribution_word(c, i)] = channel_of(glass_light, c);
  return false;
}

uint bend_place(uint p, uint i) { return bend_word(p, i, channels, queue_layout, push.capacity); }
vec3 bend_vector(uint p, uint i) { return vec3(push.bends.at[bend_place(p, i)], push.bends.at[bend_place(p + 1u, i)], push.bends.at[bend_place(p + 2u, i)]); }

/// Keeps what a search has found; the contribution itself is made by `relight`.
bool end_segment(uint i, uint state) {
  if (glass_bend.taken) {
    for (uint axis = 0u; axis < 3u; ++axis) {
      push.bends.at[bend_place(bend_direction + axis, i)] = glass_bend.taken_direction[axis];
      push.bends.at[bend_place(bend_lit + axis, i)] = glass_bend.lit[axis];
    }
    for (uint c = 0u; c < channels; ++c) push.bends.at[bend_place(bend_gain + c, i)] = channel_of(glass_bend.taken_gain, c);
  }
  if (state == bend_ends) {
    push.bends.at[bend_place(bend_found, i)] = glass_bend.total * glass_bend.share;
    return false;
  }
  ++glass_passed;
  bvh_begin(queue_world(), queue_root(i), BvhRay(glass_ray.origin, 0.0, glass_ray.direction, uintBitsToFloat(0x7f800000u), bvh_ray.time_s));
  return true;
}

MetSurface met_surface() { return MetSurface(bvh_hit.instance, bvh_hit.primitive, bvh_hit.uv.x, bvh_hit.uv.y, bvh_ray.t_far); }

/// The straight way ended: in the open, or at a surface. Glass begins the search; where there is none on the way, it may lie beside.
bool begin_search(uint i) {
  float chance = push.bends.at[bend_place(bend_chance, i)];
  bool through = bvh_found && passes_light(met_surface(), bvh_ray.time_s);
  if (!through && chance == 0.0) return bvh_found ? blocked(i) : false;
  if (push.bends.at[bend_place(bend_random, i)] < 0.0) return blocked(i);
  if (bvh_found)
    for (uint c = 0u; c < channels; ++c) push.contributions.at[contribution_word(c, i)] = 0.0;
  bool directional = (floatBitsToUint(push.bends.at[bend_place(bend_light, i)]) & bend_directional) != 0u;
  GlassBox box = push.scene.at[0].glass_boxes.at[floatBitsToUint(push.bends.at[bend_place(bend_box, i)])];
  glass_bend = begin_bend(glass_ray, bend_vector(bend_target, i), directional, box, push.bends.at[bend_place(bend_random, i)]);
  uint state;
  if (through) state = follow_bend(glass_bend, glass_ray, true, met_surface(), bvh_ray.time_s);
  else state = look_beside(glass_bend, glass_ray, 1.0 / chance);
  return end_segment(i, state);
}

bool search_on(uint i) {
  uint state = follow_bend(glass_bend, glass_ray, bvh_found, met_surface(), bvh_ray.time_s);
  return end_segment(i, state);
}

bool answer(uint i) {
  if (glass_bends) return glass_passed == 0u ? begin_search(i) : search_on(i);
  if (!bvh_found) return passed_all(i);
  if (any_hit()) return blocked(i);
  MetSurface met = MetSurface(bvh_hit.instance, bvh_hit.primitive, bvh_hit.uv.x, bvh_hit.uv.y, bvh_ray.t_far);
  glass_light *= pass_surface(met, bvh_ray.time_s, glass_ray);
  if (max_component(glass_light) == 0.0) return blocked(i);
  ++glass_passed;
  glass_ray.t_near = 0.0;
  glass_ray.t_far -= met.t;
  if (glass_ray.t_far <= 0.0) return passed_all(i);
  bvh_begin(queue_world(), queue_root(i), BvhRay(glass_ray.origin, glass_ray.t_near, glass_ray.direction, glass_ray.t_far, bvh_ray.time_s));
  return true;
}

#include "entry/bvh_main.glsl"
