// SPDX-License-Identifier: Apache-2.0
// Stage `transmit`: a shadow ray that met smooth glass goes on, dimmed, either straight or (shadow_bends) in search of the refracted path to its light, of which
// this is one segment; any other surface ends it.
#include "stage/glass.glsl"
#include "stage/bend.glsl"

struct Onward {
  bool wanted;
  Ray ray;
  uint id;
};

uint shadow_field(uint i, uint field) { return push.rays_in.at[closest_word(i, field, push.capacity)]; }
float shadow_value(uint i, uint field) { return uintBitsToFloat(shadow_field(i, field)); }
vec3 shadow_origin(uint i) { return vec3(shadow_value(i, ray_origin), shadow_value(i, ray_origin + 1u), shadow_value(i, ray_origin + 2u)); }

MetSurface met_surface(uint i) {
  return MetSurface(shadow_field(i, hit_instance), shadow_field(i, hit_primitive), shadow_value(i, hit_u), shadow_value(i, hit_v),
                    shadow_value(i, ray_t_far));
}

// Planes of push.bends: the result's, then those of the search.
uint result_word(uint p, uint at) { return bend_word(p, at, channels, queue_layout, push.capacity); }
uint search_word(uint p, uint at) { return result_word(bend_result_planes(channels) + p, at); }
uint next_plane() { return result_word(1u, 0u); }
float load_bend(uint word) { return push.bends.at[word]; }
vec3 load_bend_vector(uint word) { return vec3(push.bends.at[word], push.bends.at[word + next_plane()], push.bends.at[word + 2u * next_plane()]); }
void store_bend(uint word, float value) { push.bends.at[word] = value; }
void store_bend_vector(uint word, vec3 value) {
  for (uint axis = 0u; axis < 3u; ++axis) push.bends.at[word + axis * next_plane()] = value[axis];
}

bool is_directional(uint at) { return (floatBitsToUint(load_bend(result_word(bend_light, at))) & bend_directional) != 0u; }
GlassBox bend_box_of(uint at) { return push.scene.at[0].glass_boxes.at[floatBitsToUint(load_bend(result_word(bend_box, at)))]; }

Bend load_search(uint at) {
  Bend b = begin_bend(Ray(load_bend_vector(search_word(bend_from, at)), 0.0f, load_bend_vector(search_word(bend_trial, at)), 0.0f),
                      load_bend_vector(result_word(bend_target, at)), is_directional(at), bend_box_of(at), load_bend(result_word(bend_random, at)));
  b.share = load_bend(search_word(bend_share, at));
  b.spread = Differential(load_bend_vector(search_word(bend_spread, at)), load_bend_vector(search_word(bend_spread + 3u, at)),
                          load_bend_vector(search_word(bend_spread + 6u, at)), load_bend_vector(search_word(bend_spread + 9u, at)));
#if KUAFU_CHANNELS == 1
  b.gain = load_bend(search_word(bend_colour, at));
#else
  b.gain = load_bend_vector(search_word(bend_colour, at));
#endif
  b.length_m = load_bend(search_word(bend_length, at));
  uint counts = floatBitsToUint(load_bend(search_word(bend_counts, at)));
  b.segments = counts >> 24u;
  b.seed_segments = (counts >> 16u) & 0xffu;
  b.surfaces = (counts >> 8u) & 0xffu;
  b.seed = (counts >> 4u) & 0xfu;
  b.ways = counts & 0xfu;
  b.best = load_bend_vector(search_word(bend_best, at));
  b.error = load_bend(search_word(bend_error, at));
  b.step = vec2(load_bend(search_word(bend_step, at)), load_bend(search_word(bend_step + 1u, at)));
  b.scale = load_bend(search_word(bend_scale, at));
  b.way_0 = load_bend_vector(search_word(bend_ways, at));
  b.way_1 = load_bend_vector(search_word(bend_ways + 3u, at));
  b.way_2 = load_bend_vector(search_word(bend_ways + 6u, at));
  b.open = floatBitsToUint(load_bend(search_word(bend_open, at)));
  b.total = load_bend(result_word(bend_found, at));
  return b;
}

void store_way(IN(Bend) b, uint at) {
  store_bend_vector(result_word(bend_direction, at), b.taken_direction);
  store_bend_vector(result_word(bend_lit, at), b.lit);
  for (uint c = 0u; c < channels; ++c) store_bend(result_word(bend_gain + c, at), channel_of(b.taken_gain, c));
}

void store_search(IN(Bend) b, uint at) {
  store_bend_vector(search_word(bend_from, at), b.from);
  store_bend_vector(search_word(bend_trial, at), b.direction);
  store_bend_vector(search_word(bend_spread, at), b.spread.position_u);
  store_bend_vector(search_word(bend_spread + 3u, at), b.spread.position_v);
  store_bend_vector(search_word(bend_spread + 6u, at), b.spread.direction_u);
  store_bend_vector(search_word(bend_spread + 9u, at), b.spread.direction_v);
  for (uint c = 0u; c < channels; ++c) store_bend(search_word(bend_colour + c, at), channel_of(b.gain, c));
  store_bend(search_word(bend_share, at), b.share);
  store_bend(search_word(bend_length, at), b.length_m);
  store_bend(search_word(bend_counts, at), uintBitsToFloat(b.segments << 24u | b.seed_segments << 16u | b.surfaces << 8u | b.seed << 4u | b.ways));
  store_bend(search_word(bend_open, at), uintBitsToFloat(b.open));
  store_bend_vector(search_word(bend_best, at), b.best);
  store_bend(search_word(bend_error, at), b.error);
  store_bend(search_word(bend_step, at), b.step.x);
  store_bend(search_word(bend_step + 1u, at), b.step.y);
  store_bend(search_word(bend_scale, at), b.scale);
  store_bend(result_word(bend_random, at), b.random);
  store_bend_vector(search_word(bend_ways, at), b.way_0);
  store_bend_vector(search_word(bend_ways + 3u, at), b.way_1);
  store_bend_vector(search_word(bend_ways + 6u, at), b.way_2);
}

void darken(uint index) {
  for (uint c = 0u; c < channels; ++c) push.contributions.at[c * push.capacity + index] = 0.0f;
}

/// A search is marked by the way left, which it does not need: negative.
bool searches(uint index) { return push.contributions.at[channels * push.capacity + index] < 0.0f; }

/// What follows a segment, or the straight path.
void end_segment(IN(Bend) b, uint index, uint state, INOUT(Onward) onward) {
  if (b.taken) store_way(b, index);
  onward.wanted = state == bend_goes_on && push.last == 0u;
  store_bend(result_word(bend_found, index), onward.wanted ? b.total : b.total * b.share);
  push.contributions.at[channels * push.capacity + index] = -1.0f;
  if (!onward.wanted) return;
  store_search(b, index);
  onward.ray.t_far = uintBitsToFloat(0x7f800000u);
}

/// The straight path ended: in the open, or at a surface. Glass begins the search; where there is none on it, it may lie beside.
bool begins_search(uint i, uint index, bool hit, INOUT(Onward) onward) {
  float time_s = shadow_value(i, ray_time), chance = load_bend(result_word(bend_chance, index));
  bool through = hit && passes_light(met_surface(i), time_s);
  if (!through && chance == 0.0f) return false;
  if (hit) darken(index);
  if (load_bend(result_word(bend_random, index)) < 0.0f) return true;
  Bend b = begin_bend(onward.ray, load_bend_vector(result_word(bend_target, index)), is_directional(index), bend_box_of(index),
                      load_bend(result_word(bend_random, index)));
  uint state;
  if (through) state = follow_bend(b, onward.ray, hit, met_surface(i), time_s);
  else state = look_beside(b, onward.ray, 1.0f / chance);
  end_segment(b, index, state, onward);
  return true;
}

void search_on(uint i, uint index, bool hit, INOUT(Onward) onward) {
  Bend b = load_search(index);
  uint state = follow_bend(b, onward.ray, hit, met_surface(i), shadow_value(i, ray_time));
  end_segment(b, index, state, onward);
}

Onward transmit(uint i) {
  Onward onward = Onward(false, empty_ray(), shadow_field(i, ray_id));
  uint index = onward.id & shadow_index_mask;
  onward.ray = Ray(shadow_origin(i), 0.0f, load_direction(push.rays_in, i, push.capacity), 0.0f);
  bool hit = shadow_field(i, hit_geometry) != miss;
  if ((onward.id & shadow_bends) != 0u) {
    if (searches(index)) {
      search_on(i, index, hit, onward);
      return onward;
    }
    if (begins_search(i, index, hit, onward)) return onward;
  }
  if (!hit) return onward;
  bool blocked = push.last != 0u || (onward.id & shadow_opaque) != 0u;
  Spectrum transmittance = Spectrum(0.0f);
  if (!blocked) transmittance = pass_surface(met_surface(i), shadow_value(i, ray_time), onward.ray);
  uint way = channels * push.capacity + index;
  for (uint c = 0u; c < channels; ++c) push.contributions.at[c * push.capacity + index] *= channel_of(transmittance, c);
  if (max_component(transmittance) == 0.0f) return onward;
  float left = push.contributions.at[way] - shadow_value(i, ray_t_far);
  push.contributions.at[way] = left;
  onward.ray.t_far = left;
  onward.wanted = left > 0.0f;
  return onward;
}

void queue_onward(uint from, Onward onward, uint i) {
  store_closest_ray(push.rays_out, i, push.capacity, onward.ray, shadow_value(from, ray_time), onward.id);
  if (push.has_environments != 0u) push.environments_out.at[i] = push.environments_in.at[from];
}
