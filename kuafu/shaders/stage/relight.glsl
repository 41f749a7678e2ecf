// SPDX-License-Identifier: Apache-2.0
// Stage `relight`, after stage/shade.glsl: the light that arrives on a refracted path (stage/bend.glsl) from another direction than the straight one that `shade` asked.
float bend_value(uint p, uint at) { return push.bends.at[bend_word(p, at, channels, queue_layout, push.shadow_capacity)]; }
vec3 bend_vector(uint p, uint at) { return vec3(bend_value(p, at), bend_value(p + 1u, at), bend_value(p + 2u, at)); }

Spectrum bend_spectrum(uint p, uint at) {
#if KUAFU_CHANNELS == 1
  return bend_value(p, at);
#else
  return bend_vector(p, at);
#endif
}

/// f cos, or the phase function in fog, where ray i ended.
Spectrum scattered_towards(uint i, uint k, vec3 direction, float time_s) {
  if (in_medium() && k >= surface_rays())
    return Spectrum(phase(push.scene.at[0].medium.at[0].phase_g, dot(load_direction(push.rays_in, i, push.capacity), direction)));
  Vertex vertex;
  meet_surface(i, time_s, vertex);
  set_bsdf(vertex);
  vec3 wi = to_local(vertex.frame, direction);
  bool behind = dot(direction, vertex.side_normal) <= 0.0f;
  if (behind != (wi.z <= 0.0f) || (behind && !takes_light_behind(vertex.bsdf))) return Spectrum(0.0f);
  float pdf;
  return bsdf_evaluate(vertex.bsdf, push.scene.at[0].specular_albedo, vertex.wo, wi, vertex.chances, pdf);
}

void relight_shadow(uint i, uint slot, uint k, uint at) {
  float time_s = 0.0f;
  if ((features & feature_motion) != 0u) time_s = uintBitsToFloat(ray_field(i, ray_time));
  vec2 point = vec2(0.0f);
  if ((features & feature_lights) != 0u)
    point = sample_2d(push.state.at[plane(state_pixel_key, slot)], push.state.at[plane(state_sample, slot)], pair_light_point(push.bounce, k));
  uint light = floatBitsToUint(bend_value(bend_light, at)) & ~bend_directional;
  Spectrum arriving = light_towards(push.scene.at[0], light, bend_vector(bend_lit, at), point, time_s).irradiance;
  arriving *= bend_value(bend_found, at) * bend_spectrum(bend_gain, at) * bend_spectrum(bend_weight(channels), at);
  if (max_component(arriving) > 0.0f) arriving *= scattered_towards(i, k, bend_vector(bend_direction, at), time_s);
  for (uint c = 0u; c < channels; ++c) push.contributions.at[c * push.shadow_capacity + at] += channel_of(arriving, c);
}

void relight(uint i) {
  uint slot = ray_field(i, ray_id);
  for (uint k = 0u; k < push.shadow_rays_per_vertex; ++k) {
    uint shadow = push.state.at[plane(state_shadow(channels, push.groups) + k, slot)];
    if (shadow == shadow_none) continue;
    uint at = shadow & shadow_index_mask;
    if (bend_value(bend_found, at) != 0.0f) relight_shadow(i, slot, k, at);
  }
}
