// Stage `transmit`: a shadow ray that met smooth glass goes straight on, dimmed; any other surface ends it. The light's pattern so reaches what stands
// behind a bottle; its bending does not.
struct Onward {
  bool wanted;
  Ray ray;
  uint id;
};

uint shadow_field(uint i, uint field) { return push.rays_in.at[closest_word(i, field, push.capacity)]; }

/// `shade` took the medium to fill the whole way; what of it lies in a body does not dim.
Spectrum inside_instead_of_fog(uint i) {
  if (push.has_medium == 0u) return Spectrum(1.0f);
  vec3 origin = vec3(uintBitsToFloat(shadow_field(i, ray_origin)), uintBitsToFloat(shadow_field(i, ray_origin + 1u)),
                     uintBitsToFloat(shadow_field(i, ray_origin + 2u)));
  Spectrum dimmed = medium_transmittance(push.scene.at[0].medium.at[0], origin, load_direction(push.rays_in, i, push.capacity),
                                         uintBitsToFloat(shadow_field(i, ray_t_far)));
  return Spectrum(1.0f) / max(dimmed, Spectrum(1e-30f));
}

/// What the surface at ray i lets through, straight; `onward` gets the ray's next origin.
Spectrum pass_surface(uint i, INOUT(Onward) onward) {
  IN(SceneAddresses) scene = push.scene.at[0];
  Surface s = surface_at(scene, shadow_field(i, hit_instance), shadow_field(i, hit_primitive), uintBitsToFloat(shadow_field(i, hit_u)),
                         uintBitsToFloat(shadow_field(i, hit_v)), uintBitsToFloat(shadow_field(i, ray_time)));
  MaterialPoint m = load_material(scene, scene.materials.at[s.material], s);
  bool front = dot(s.geometric_normal, onward.ray.direction) <= 0.0f;
  onward.ray.origin = offset_origin(s.position, s.coordinate_size, front ? -s.geometric_normal : s.geometric_normal);
  Spectrum transmittance = straight_transmittance(m, abs(dot(s.shading_normal, onward.ray.direction)));
  if ((features & feature_materials) != 0u && !front) transmittance *= band_exp(m.attenuation * -uintBitsToFloat(shadow_field(i, ray_t_far)));
  if ((features & feature_medium) != 0u && !front && m.transmission > 0.0f && max_component(transmittance) > 0.0f)
    transmittance *= inside_instead_of_fog(i);
  return transmittance;
}

Onward transmit(uint i) {
  Onward onward;
  onward.wanted = false;
  if (shadow_field(i, hit_geometry) == miss) return onward;
  onward.id = shadow_field(i, ray_id);
  onward.ray.direction = load_direction(push.rays_in, i, push.capacity);
  bool blocked = push.last != 0u || (onward.id & shadow_opaque) != 0u;
  Spectrum transmittance = Spectrum(0.0f);
  if (!blocked) transmittance = pass_surface(i, onward);
  uint index = onward.id & ~shadow_opaque, way = channels * push.capacity + index;
  for (uint c = 0u; c < channels; ++c) push.contributions.at[c * push.capacity + index] *= channel_of(transmittance, c);
  if (max_component(transmittance) == 0.0f) return onward;
  float left = push.contributions.at[way] - uintBitsToFloat(shadow_field(i, ray_t_far));
  push.contributions.at[way] = left;
  onward.ray.t_near = 0.0f;
  onward.ray.t_far = left;
  onward.wanted = left > 0.0f;
  return onward;
}

void queue_onward(uint from, Onward onward, uint i) {
  store_closest_ray(push.rays_out, i, push.capacity, onward.ray, uintBitsToFloat(shadow_field(from, ray_time)), onward.id);
  if (push.has_environments != 0u) push.environments_out.at[i] = push.environments_in.at[from];
}
