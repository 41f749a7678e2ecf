// SPDX-License-Identifier: Apache-2.0
// Adds the light of the shadow rays that got through, path by path in the order of the rays: no two invocations touch one path.
void add_light(uint slot, uint shadow) {
  uint i = shadow & ((1u << shadow_group_shift) - 1u), group = shadow >> shadow_group_shift;
  if (push.glass_shadows == 0u && uintBitsToFloat(push.shadow_rays.at[occlusion_word(i, ray_t_far, push.shadow_capacity)]) < 0.0f) return;
  for (uint c = 0u; c < push.channels; ++c) {
    uint word = (state_radiance(push.channels) + group * push.channels + c) * push.capacity + slot;
    push.state.at[word] = floatBitsToUint(uintBitsToFloat(push.state.at[word]) + push.contributions.at[c * push.shadow_capacity + i]);
  }
}

void resolve(uint i) {
  uint slot = push.rays.at[closest_word(i, ray_id, push.capacity)];
  for (uint k = 0u; k < push.shadow_rays_per_vertex; ++k) {
    uint shadow = push.state.at[(state_shadow(push.channels, push.groups) + k) * push.capacity + slot];
    if (shadow != shadow_none) add_light(slot, shadow);
  }
}
