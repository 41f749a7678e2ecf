// What stage `shade` asks for, written to the places in the queues that its caller found.
void queue_shadow(IN(Path) path, IN(ShadowRequest) request, uint k, uint i) {
  if ((push.flags & shade_glass_shadows) != 0u) {
    store_closest_ray(push.shadow_rays, i, push.shadow_capacity, request.ray, path.time_s, request.opaque ? i | shadow_opaque : i);
    push.contributions.at[channels * push.shadow_capacity + i] = request.ray.t_far;
  } else {
    store_ray(push.shadow_rays, i, occlusion_words, push.shadow_capacity, request.ray, path.time_s, request.opaque ? i | shadow_opaque : i);
  }
  if ((push.flags & shade_environments) != 0u) push.shadow_environments.at[i] = path_environment(path);
  for (uint c = 0u; c < channels; ++c) push.contributions.at[c * push.shadow_capacity + i] = channel_of(request.contribution, c);
  push.state.at[plane(state_shadow(channels, push.groups) + k, path.slot)] = i | (request.group << shadow_group_shift);
}

void queue_no_shadow(IN(Path) path, uint k) { push.state.at[plane(state_shadow(channels, push.groups) + k, path.slot)] = shadow_none; }

void queue_next(IN(Path) path, IN(NextRequest) request, uint i) {
  store_closest_ray(push.rays_out, i, push.capacity, request.ray, path.time_s, path.slot);
  if ((push.flags & shade_environments) != 0u) push.ray_environments.at[i] = path_environment(path);
  store_path(path);
}
