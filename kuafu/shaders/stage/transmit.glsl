// SPDX-License-Identifier: Apache-2.0
// Stage `transmit`: a shadow ray that met smooth glass goes on straight, dimmed; any other surface ends it.
#include "stage/glass.glsl"

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

Onward transmit(uint i) {
  Onward onward = Onward(false, empty_ray(), shadow_field(i, ray_id));
  uint index = onward.id & shadow_index_mask;
  onward.ray = Ray(shadow_origin(i), 0.0f, load_direction(push.rays_in, i, push.capacity), 0.0f);
  bool hit = shadow_field(i, hit_geometry) != miss;
  if (!hit) return onward;
  bool blocked = push.last != 0u || (onward.id & shadow_opaque) != 0u;
  Spectrum transmittance = Spectrum(0.0f);
  if (!blocked) transmittance = pass_surface(met_surface(i), shadow_value(i, ray_time), (onward.id & shadow_bent) != 0u, onward.ray);
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
