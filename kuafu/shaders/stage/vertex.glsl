// SPDX-License-Identifier: Apache-2.0
// What a path of stage `shade` met where its ray ended: lights with a shape on the way, and the surface, ready to be lit and to scatter.
struct Vertex {
  uint body_beyond;  // Path.body of a ray that is transmitted
  vec3 position;
  float coordinate_size;
  vec3 side_normal;  // geometric, on the viewer's side
  Frame frame;       // shading, on the viewer's side
  vec3 wo;           // local
  MaterialPoint material;
  bool front;       // the viewer is outside
  bool from_below;  // the path comes out of the body
  Bsdf bsdf;        // and chances: by set_bsdf
  vec3 chances;
};

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
    if (open) hit.radiance *= path_transmittance(origin, direction, hit.t);
    add_radiance(path.slot, ambient_group(light.light_group, depth(path)), path.throughput * hit.radiance * weight);
  }
}

/// What is left after a way that ended at this surface: the body absorbs that the path is in, also before an immersed thing.
Spectrum absorbed(IN(Path) path, IN(MaterialPoint) m, bool front, float t) {
  Spectrum attenuation = !front && m.transmission + m.diffuse_transmission > 0.0f ? m.attenuation : Spectrum(0.0f);
  if (path.body != 0u) {
    IN(MaterialRecord) body = push.scene.at[0].materials.at[path.body - 1u];
    attenuation = band_of(body.attenuation);
  }
  return band_exp(attenuation * -t);
}

/// An interpolated normal may face away from the viewer, where GGX is not defined: it is bent back. Lambert needs no viewer.
vec3 normal_in_view(vec3 normal, vec3 wo, bool needs_viewer) {
  float facing = dot(normal, wo);
  vec3 bent = normalize(normal + (1e-3f - facing) * wo);
  bool bend = facing < 1e-3f && needs_viewer;
  return vec3(bend ? bent.x : normal.x, bend ? bent.y : normal.y, bend ? bent.z : normal.z);
}

/// The surface that ray i met.
Surface meet_surface(uint i, float time_s, OUT(Vertex) vertex) {
  vec3 wo = -load_direction(push.rays_in, i, push.capacity);
  IN(SceneAddresses) scene = push.scene.at[0];
  Surface s = surface_at(scene, ray_field(i, hit_instance), ray_field(i, hit_primitive), uintBitsToFloat(ray_field(i, hit_u)),
                         uintBitsToFloat(ray_field(i, hit_v)), time_s);
  IN(MaterialRecord) record = scene.materials.at[s.material];
  MaterialPoint m = load_material(scene, record, s);
  bool front = dot(s.geometric_normal, wo) >= 0.0f;
  vertex.position = s.position;
  vertex.coordinate_size = s.coordinate_size;
  vertex.side_normal = front ? s.geometric_normal : -s.geometric_normal;
  vertex.body_beyond = front ? s.material + 1u : 0u;
  vec3 normal = normal_in_view(s.shading_normal * (front ? 1.0f : -1.0f), wo, m.specular + m.metallic + m.clearcoat + max_component(m.sheen) > 0.0f);
  if ((features & feature_anisotropy) != 0u && m.anisotropy > 0.0f) vertex.frame = frame_along(normal, m.tangent);
  else vertex.frame = frame_around(normal);
  vertex.wo = to_local(vertex.frame, wo);
  vertex.material = m;
  vertex.front = front;
  vertex.from_below = false;
  return s;
}

/// The surface that ray i met; the path loses what the way inside absorbed, and gets the surface's emission.
void load_vertex(uint i, INOUT(Path) path, OUT(Vertex) vertex) {
  Surface s = meet_surface(i, path.time_s, vertex);
  IN(MaterialPoint) m = vertex.material;
  float t = uintBitsToFloat(ray_field(i, ray_t_far));
  if (is_sheet(m)) vertex.body_beyond = path.body;
  if ((features & feature_materials) != 0u) path.throughput *= absorbed(path, m, vertex.front, t);
  if ((features & feature_dispersion) != 0u) vertex.material.carries = path.throughput;
  if (max_component(m.emission) == 0.0f) return;
  IN(MaterialRecord) record = push.scene.at[0].materials.at[s.material];
  float weight = emission_weight(path, record, t, -dot(s.geometric_normal, load_direction(push.rays_in, i, push.capacity)));
  add_radiance(path.slot, ambient_group(record.light_group, depth(path)), path.throughput * m.emission * weight);
}

void set_bsdf(INOUT(Vertex) vertex) {
  if ((features & feature_clearcoat) != 0u) {
    vec3 normal = to_local(vertex.frame, vertex.material.clearcoat_normal * (vertex.front ? 1.0f : -1.0f));
    vertex.material.clearcoat_normal = normal_in_view(normal, vertex.wo, true);
  }
  vertex.bsdf = make_bsdf(vertex.material, push.scene.at[0].specular_albedo, vertex.wo, vertex.front);
  vertex.chances = lobe_chances(vertex.bsdf);
  if (!can_walk() || !vertex.from_below) return;
  // Seen through the layer by the light alone: what the layer keeps from the viewer was taken where the path entered.
  vertex.bsdf.layer = vertex.bsdf.coat_albedo = 0.0f;
  vertex.bsdf.multiple = Spectrum(0.0f);
  vertex.bsdf.clearcoat.share = vertex.bsdf.clearcoat.chance = 0.0f;
  vertex.bsdf.sheen.share = vertex.bsdf.sheen.taken = vertex.bsdf.sheen.chance = 0.0f;
  vertex.chances = vec3(1.0f, 0.0f, 0.0f);
}
