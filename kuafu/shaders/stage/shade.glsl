// Stage `shade`: what a path does where its ray ended. Light that is simply there (environment, emission) is added; for each light one shadow ray is asked
// for; the BSDF gives the next ray. The caller queues both.
struct Path {
  uint slot, key, index, flags;
  float pdf;
  Spectrum throughput;
};

struct Vertex {
  vec3 position;
  float coordinate_size;
  vec3 side_normal;  // geometric, on the viewer's side
  Frame frame;       // shading, on the viewer's side
  vec3 wo;           // local
  Bsdf bsdf;
  vec3 chances;
};

struct Shading {
  Path path;
  Vertex vertex;
  bool hit;  // and not beyond the last bounce
};

struct ShadowRequest {
  bool wanted;
  bool opaque;  // glass stops it
  Ray ray;
  Spectrum contribution;
  uint group;
};

struct NextRequest {
  bool wanted;
  Ray ray;
};

uint plane(uint p, uint slot) { return p * push.capacity + slot; }
float load_float(uint p, uint slot) { return uintBitsToFloat(push.state.at[plane(p, slot)]); }
void store_float(uint p, uint slot, float value) { push.state.at[plane(p, slot)] = floatBitsToUint(value); }
uint ray_field(uint i, uint field) { return push.rays_in.at[closest_word(i, field, push.capacity)]; }

Path load_path(uint i) {
  Path p;
  p.slot = ray_field(i, ray_id);
  p.key = push.state.at[plane(state_pixel_key, p.slot)];
  p.index = push.state.at[plane(state_sample, p.slot)];
  p.flags = push.state.at[plane(state_flags, p.slot)];
  p.pdf = 0.0f;
  if ((features & feature_lights) != 0u && push.bounce > 0u) p.pdf = load_float(state_pdf, p.slot);
#if KUAFU_CHANNELS == 1
  p.throughput = load_float(state_throughput, p.slot);
#else
  p.throughput = vec3(load_float(state_throughput, p.slot), load_float(state_throughput + 1u, p.slot), load_float(state_throughput + 2u, p.slot));
#endif
  return p;
}

void store_path(Path p) {
  push.state.at[plane(state_flags, p.slot)] = p.flags;
  if ((features & feature_lights) != 0u) store_float(state_pdf, p.slot, p.pdf);
  for (uint c = 0u; c < channels; ++c) store_float(state_throughput + c, p.slot, channel_of(p.throughput, c));
}

void add_radiance(uint slot, uint group, Spectrum radiance) {
  for (uint c = 0u; c < channels; ++c) {
    uint p = state_radiance(channels) + group * channels + c;
    store_float(p, slot, load_float(p, slot) + channel_of(radiance, c));
  }
}

/// Where light groups are not kept apart, all are the first.
uint ambient_group(uint light_group) { return group_ambient + min(light_group, push.groups - group_count); }

uint path_environment(Path path) { return path.flags & path_environment_mask; }
bool all_delta(Path path) { return (path.flags & path_all_delta) != 0u; }

/// Weight of light `index` where the path's direction, not a light sample, found it; pdf: that of the light sample.
float found_weight(Path path, uint index, float pdf) {
  if (path.pdf == 0.0f || (push.flags & shade_bsdf_only) != 0u) return 1.0f;
  if ((push.flags & shade_lights_only) != 0u) return 0.0f;
  LightRecord light = push.scene.at[0].lights.at[index];
  if ((push.flags & shade_select_lights) != 0u) pdf *= (path.flags & path_after_first) != 0u ? light.other_probability : light.probability;
  return mis_weight(path.pdf, pdf);
}

float emission_weight(Path path, MaterialRecord m, float t, float cosine) {
  if ((features & feature_lights) == 0u) return 1.0f;
  uint index = push.scene.at[0].environments.at[path_environment(path)].mesh_light;
  return index == miss ? 1.0f : found_weight(path, index, mesh_pdf(m, push.scene.at[0].light_shapes.at[index], t, cosine));
}

/// Adds the light of shapes that the ray meets before t_far.
void add_shapes(uint i, Path path, float t_far) {
  SceneAddresses scene = push.scene.at[0];
  EnvironmentRecord environment = scene.environments.at[path_environment(path)];
  vec3 origin = vec3(uintBitsToFloat(ray_field(i, ray_origin)), uintBitsToFloat(ray_field(i, ray_origin + 1u)),
                     uintBitsToFloat(ray_field(i, ray_origin + 2u)));
  vec3 direction = load_direction(push.rays_in, i, push.capacity);
  float t_near = uintBitsToFloat(ray_field(i, ray_t_near));
  for (uint k = environment.first_shape; k < environment.light_count; ++k) {
    uint index = environment.first_light + k;
    LightRecord light = scene.lights.at[index];
    ShapeHit hit = meet_light(scene, light, scene.light_shapes.at[index], origin, direction);
    if (!hit.found || hit.t < t_near || hit.t > t_far) continue;
    float weight = found_weight(path, index, hit.pdf);
    if (weight > 0.0f) add_radiance(path.slot, ambient_group(light.light_group), path.throughput * hit.radiance * weight);
  }
}

/// The surface that ray i met; the path loses what the way inside absorbed, and gets the surface's emission.
Vertex load_vertex(uint i, INOUT(Path) path) {
  vec3 wo = -load_direction(push.rays_in, i, push.capacity);
  SceneAddresses scene = push.scene.at[0];
  Surface s = load_surface(scene, scene.instances.at[ray_field(i, hit_instance)], ray_field(i, hit_primitive),
                           uintBitsToFloat(ray_field(i, hit_u)), uintBitsToFloat(ray_field(i, hit_v)));
  MaterialRecord record = scene.materials.at[s.material];
  MaterialPoint m = load_material(scene, record, s);
  bool front = dot(s.geometric_normal, wo) >= 0.0f;
  if ((features & feature_materials) != 0u && !front && m.transmission > 0.0f)
    path.throughput *= band_exp(m.attenuation * -uintBitsToFloat(ray_field(i, ray_t_far)));
  if (max_component(m.emission) > 0.0f) {
    float weight = emission_weight(path, record, uintBitsToFloat(ray_field(i, ray_t_far)), dot(s.geometric_normal, wo));
    add_radiance(path.slot, ambient_group(record.light_group), path.throughput * m.emission * weight);
  }
  Vertex vertex;
  vertex.position = s.position;
  vertex.coordinate_size = s.coordinate_size;
  vertex.side_normal = front ? s.geometric_normal : -s.geometric_normal;
  vec3 normal = front ? s.shading_normal : -s.shading_normal;
  // An interpolated normal may face away from the viewer, where GGX is not defined: bend it back. Lambert needs no viewer.
  float facing = dot(normal, wo);
  if (facing < 1e-3f && m.specular + m.metallic > 0.0f) normal = normalize(normal + (1e-3f - facing) * wo);
  vertex.frame = frame_around(normal);
  vertex.wo = to_local(vertex.frame, wo);
  vertex.bsdf = make_bsdf(m, scene.specular_albedo, vertex.wo.z, front);
  vertex.chances = lobe_chances(vertex.bsdf, scene.specular_albedo, vertex.wo.z);
  return vertex;
}

Shading begin_shading(uint i) {
  Shading s;
  s.path = load_path(i);
  s.hit = ray_field(i, hit_geometry) != miss;
  if ((features & feature_lights) != 0u) add_shapes(i, s.path, s.hit ? uintBitsToFloat(ray_field(i, ray_t_far)) : 2.0f * infinite_m);
  if (s.hit) {
    s.vertex = load_vertex(i, s.path);
    s.hit = push.bounce <= push.max_bounces;
  } else {
    EnvironmentRecord environment = push.scene.at[0].environments.at[path_environment(s.path)];
    add_radiance(s.path.slot, ambient_group(environment.light_group), s.path.throughput * band_of(environment.radiance, environment.radiance.x));
  }
  return s;
}

/// The k-th shadow ray of the vertex.
ShadowRequest ask_light(Shading s, uint k) {
  ShadowRequest request;
  request.wanted = false;
  SceneAddresses scene = push.scene.at[0];
  bool select = (push.flags & shade_select_lights) != 0u;
  float u = select ? sample_2d(s.path.key, s.path.index, pair_light(push.bounce)).x : 0.0f;
  EnvironmentRecord environment = scene.environments.at[path_environment(s.path)];
  LightChoice choice = vertex_light(scene.lights, environment, k, select, all_delta(s.path), u);
  if (choice.probability == 0.0f) return request;
  LightRecord record = scene.lights.at[choice.index];
  LightSample light;
  if ((features & feature_lights) != 0u) {
    request.ray.origin = offset_origin(s.vertex.position, s.vertex.coordinate_size, s.vertex.side_normal);
    vec2 point = sample_2d(s.path.key, s.path.index, pair_light_point(push.bounce, k));
    light = sample_light(scene, record, scene.light_shapes.at[choice.index], request.ray.origin, point);
    if (light.pdf > 0.0f && (push.flags & shade_bsdf_only) != 0u) return request;
  } else {
    light = light_at(record, s.vertex.position);
  }
  bool behind = dot(light.direction, s.vertex.side_normal) <= 0.0f;
  if (max_component(light.irradiance) == 0.0f || (behind && !is_rough_glass(s.vertex.bsdf))) return request;
  request.ray.origin = offset_origin(s.vertex.position, s.vertex.coordinate_size, s.vertex.side_normal);
  if (behind) {
    request.ray.origin = offset_origin(s.vertex.position, s.vertex.coordinate_size, -s.vertex.side_normal);
    light.distance_m -= s.vertex.coordinate_size * (1.0f / 65536.0f);  // nearer by both offsets
  }
  float pdf;
  vec3 wi = to_local(s.vertex.frame, light.direction);
  if (behind == (wi.z > 0.0f)) return request;
  Spectrum f = bsdf_evaluate(s.vertex.bsdf, scene.specular_albedo, s.vertex.wo, wi, s.vertex.chances, pdf);
  request.contribution = s.path.throughput * f * light.irradiance / choice.probability;
  request.opaque = light.pdf > 0.0f;  // directions that find it go through glass by themselves
  if (request.opaque && (push.flags & shade_lights_only) == 0u) request.contribution *= mis_weight(light.pdf * choice.probability, pdf);
  request.wanted = max_component(request.contribution) > 0.0f;
  uint light_group = (features & feature_lights) != 0u && record.kind == light_mesh ? light.light_group : record.light_group;
  request.group = record.kind != light_projector ? ambient_group(light_group) : all_delta(s.path) ? group_projector_direct : group_projector_indirect;
  request.ray.t_near = 0.0f;
  request.ray.direction = light.direction;
  request.ray.t_far = light.distance_m * 0.99999f;
  return request;
}

/// Samples the next ray; none when the path ends here.
NextRequest scatter(INOUT(Shading) s) {
  NextRequest request;
  request.wanted = false;
  bool roulette = push.bounce >= 3u;
  vec2 choice = vec2(0.0f);  // where there is nothing to choose, not drawn
  if (roulette || s.vertex.chances.x < 1.0f) choice = sample_2d(s.path.key, s.path.index, pair_choice(push.bounce));
  vec2 u = sample_2d(s.path.key, s.path.index, pair_direction(push.bounce));
  BsdfSample b = bsdf_sample(s.vertex.bsdf, push.scene.at[0].specular_albedo, s.vertex.wo, s.vertex.chances, u, choice.x);
  vec3 direction = to_world(s.vertex.frame, b.direction);
  // The shading normal may send a ray to the wrong side of the triangle.
  if (b.transmitted == (dot(direction, s.vertex.side_normal) > 0.0f)) return request;
  s.path.throughput *= b.weight;
  s.path.pdf = b.pdf;
  if (!b.delta) s.path.flags = (s.path.flags & ~(path_all_delta | path_after_first)) | (all_delta(s.path) ? path_after_first : 0u);
  float survival = max_component(s.path.throughput);
  if (roulette && survival < 1.0f) {
    if (choice.y >= survival) return request;
    s.path.throughput /= survival;
  }
  request.wanted = survival > 0.0f;
  vec3 outward = b.transmitted ? -s.vertex.side_normal : s.vertex.side_normal;
  request.ray = Ray(offset_origin(s.vertex.position, s.vertex.coordinate_size, outward), 0.0f, direction, uintBitsToFloat(0x7f800000u));
  return request;
}

bool goes_on(Shading s) { return s.hit && (push.bounce < push.max_bounces || (push.flags & shade_ambient) != 0u); }

void queue_shadow(Path path, ShadowRequest request, uint k, uint i) {
  if ((push.flags & shade_glass_shadows) != 0u) {
    store_closest_ray(push.shadow_rays, i, push.shadow_capacity, request.ray, request.opaque ? i | shadow_opaque : i);
    push.contributions.at[channels * push.shadow_capacity + i] = request.ray.t_far;
  } else {
    store_ray(push.shadow_rays, i, occlusion_words, push.shadow_capacity, request.ray, path.slot);
  }
  if ((push.flags & shade_environments) != 0u) push.shadow_environments.at[i] = path_environment(path);
  for (uint c = 0u; c < channels; ++c) push.contributions.at[c * push.shadow_capacity + i] = channel_of(request.contribution, c);
  push.state.at[plane(state_shadow(channels, push.groups) + k, path.slot)] = i | (request.group << shadow_group_shift);
}

void queue_no_shadow(Path path, uint k) { push.state.at[plane(state_shadow(channels, push.groups) + k, path.slot)] = shadow_none; }

void queue_next(Path path, NextRequest request, uint i) {
  store_closest_ray(push.rays_out, i, push.capacity, request.ray, path.slot);
  if ((push.flags & shade_environments) != 0u) push.ray_environments.at[i] = path_environment(path);
  store_path(path);
}
