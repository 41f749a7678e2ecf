// SPDX-License-Identifier: Apache-2.0
// A path as stage `shade` holds it: its words of the wave's state, its flags, what it adds to its pixel.
struct Path {
  uint slot, key, index, flags;
  uint body;  // as state_body
  float pdf;
  float time_s;
  Spectrum throughput;
};

uint plane(uint p, uint slot) { return p * push.capacity + slot; }
float load_float(uint p, uint slot) { return uintBitsToFloat(push.state.at[plane(p, slot)]); }
void store_float(uint p, uint slot, float value) { push.state.at[plane(p, slot)] = floatBitsToUint(value); }
uint ray_field(uint i, uint field) { return push.rays_in.at[closest_word(i, field, push.capacity)]; }

bool can_walk() { return (features & feature_subsurface) != 0u; }
bool tracks_body() { return (features & (feature_materials | feature_medium)) != 0u; }

Path load_path(uint i) {
  Path p;
  p.slot = ray_field(i, ray_id);
  p.key = push.state.at[plane(state_pixel_key, p.slot)];
  p.index = push.state.at[plane(state_sample, p.slot)];
  p.flags = push.state.at[plane(state_flags, p.slot)];
  p.pdf = p.time_s = 0.0f;
  if ((features & feature_motion) != 0u) p.time_s = uintBitsToFloat(ray_field(i, ray_time));
  p.body = 0u;
  if (tracks_body() && push.bounce > 0u) p.body = push.state.at[plane(state_body, p.slot)];
  if ((features & feature_lights) != 0u && push.bounce > 0u) p.pdf = load_float(state_pdf, p.slot);
#if KUAFU_CHANNELS == 1
  p.throughput = load_float(state_throughput, p.slot);
#else
  p.throughput = vec3(load_float(state_throughput, p.slot), load_float(state_throughput + 1u, p.slot), load_float(state_throughput + 2u, p.slot));
#endif
  return p;
}

void store_path(IN(Path) p) {
  push.state.at[plane(state_flags, p.slot)] = p.flags;
  if (tracks_body()) push.state.at[plane(state_body, p.slot)] = p.body;
  if ((features & feature_lights) != 0u) store_float(state_pdf, p.slot, p.pdf);
  for (uint c = 0u; c < channels; ++c) store_float(state_throughput + c, p.slot, channel_of(p.throughput, c));
}

vec3 load_origin(uint i) {
  return vec3(uintBitsToFloat(ray_field(i, ray_origin)), uintBitsToFloat(ray_field(i, ray_origin + 1u)), uintBitsToFloat(ray_field(i, ray_origin + 2u)));
}

void add_radiance(uint slot, uint group, Spectrum radiance) {
  for (uint c = 0u; c < channels; ++c) {
    uint p = state_radiance(channels) + group * channels + c;
    store_float(p, slot, load_float(p, slot) + channel_of(radiance, c));
  }
}

uint walked(IN(Path) path) { return (path.flags >> path_walk_shift) & path_walk_mask; }

/// Surfaces (and scatterings of a medium) that the path has met.
uint depth(IN(Path) path) { return can_walk() ? push.bounce - walked(path) : push.bounce; }

/// met: the surfaces (and scatterings) on the light's way. Where light groups are not kept apart, all are the first.
uint ambient_group(uint light_group, uint met) {
  if ((push.flags & shade_direct_apart) != 0u) return group_ambient + (met > 1u ? 1u : 0u);
  return group_ambient + min(light_group, push.groups - group_count);
}

uint path_environment(IN(Path) path) { return path.flags & path_environment_mask; }
bool all_delta(IN(Path) path) { return (path.flags & path_all_delta) != 0u; }

/// The path is scattered by something rough.
void leave_first(INOUT(Path) path) {
  path.flags = (path.flags & ~(path_all_delta | path_after_first)) | (all_delta(path) ? path_after_first : 0u);
}

const uint first_roulette = 2u;  // bounce

/// Russian roulette by twice the largest channel of the throughput: with the throughput alone, few paths carry much, and the last bounces
/// bring half of the noise.
bool survives(INOUT(Path) path, float u) {
  float survival = 2.0f * max_component(path.throughput);
  bool sure = push.bounce < first_roulette || survival >= 1.0f;
  path.throughput /= sure ? 1.0f : survival;
  return sure ? survival > 0.0f : u < survival;
}

struct NextRequest {
  bool wanted;
  Ray ray;
};

NextRequest no_next_request() { return NextRequest(false, empty_ray()); }
