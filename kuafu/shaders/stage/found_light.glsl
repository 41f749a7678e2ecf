// Light with an extent that a path's own ray finds, in stage `shade`: weighted against the light samples that might have.
/// Weight of light `index` where the path's direction, not a light sample, found it; pdf: that of the light sample.
float found_weight(IN(Path) path, uint index, float pdf) {
  if (path.pdf == 0.0f || (push.flags & shade_bsdf_only) != 0u) return 1.0f;
  if ((push.flags & shade_lights_only) != 0u) return 0.0f;
  IN(LightRecord) light = push.scene.at[0].lights.at[index];
  if ((push.flags & shade_select_lights) != 0u) pdf *= (path.flags & path_after_first) != 0u ? light.other_probability : light.probability;
  return mis_weight(path.pdf, pdf);
}

float emission_weight(IN(Path) path, IN(MaterialRecord) m, float t, float cosine) {
  if ((features & feature_lights) == 0u) return 1.0f;
  uint index = push.scene.at[0].environments.at[path_environment(path)].mesh_light;
  return index == miss ? 1.0f : found_weight(path, index, mesh_pdf(m, push.scene.at[0].light_shapes.at[index], t, cosine));
}

/// Adds the light of shapes that the ray meets before t_far.
void add_shapes(uint i, IN(Path) path, float t_far, bool open) {
  IN(SceneAddresses) scene = push.scene.at[0];
  IN(EnvironmentRecord) environment = scene.environments.at[path_environment(path)];
  vec3 origin = load_origin(i), direction = load_direction(push.rays_in, i, push.capacity);
  float t_near = uintBitsToFloat(ray_field(i, ray_t_near));
  for (uint k = environment.first_shape; k < environment.light_count; ++k) {
    uint index = environment.first_light + k;
    IN(LightRecord) light = scene.lights.at[index];
    ShapeHit hit = meet_moving_light(scene, index, origin, direction, path.time_s);
    if (!hit.found || hit.t < t_near || hit.t > t_far) continue;
    float weight = found_weight(path, index, hit.pdf);
    if (weight == 0.0f) continue;
    if (open) hit.radiance *= open_transmittance(origin, direction, hit.t);
    add_radiance(path.slot, ambient_group(light.light_group), path.throughput * hit.radiance * weight);
  }
}
