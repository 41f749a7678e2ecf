// Stage `shade`: what a path does where its ray ended. Light that is simply there (environment, emission) is added; for each light one shadow ray is asked
// for; the BSDF gives the next ray. The caller queues both.
struct Path {
  uint slot, key, index, flags;
  uint body;  // as state_body
  float pdf;
  float time_s;
  Spectrum throughput;
};

struct Vertex {
  uint body_beyond;  // Path.body of a ray that is transmitted
  vec3 position;
  float coordinate_size;
  vec3 side_normal;  // geometric, on the viewer's side
  Frame frame;       // shading, on the viewer's side
  vec3 wo;           // local
  Bsdf bsdf;
  vec3 chances;
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

void store_path(Path p) {
  push.state.at[plane(state_flags, p.slot)] = p.flags;
  if (tracks_body()) push.state.at[plane(state_body, p.slot)] = p.body;
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

/// The path is scattered by something rough.
void leave_first(INOUT(Path) path) {
  path.flags = (path.flags & ~(path_all_delta | path_after_first)) | (all_delta(path) ? path_after_first : 0u);
}

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

vec3 load_origin(uint i) {
  return vec3(uintBitsToFloat(ray_field(i, ray_origin)), uintBitsToFloat(ray_field(i, ray_origin + 1u)), uintBitsToFloat(ray_field(i, ray_origin + 2u)));
}

/// A light that a vertex asks, before visibility.
struct LightRequest {
  bool found;
  float probability;  // of this light among all
  bool projector;
  uint group;  // of light that is no projector's
  LightSample light;
};

LightRequest find_light(IN(Path) path, vec3 position, vec3 shape_origin, uint k) {
  LightRequest request;
  request.found = false;
  SceneAddresses scene = push.scene.at[0];
  bool select = (push.flags & shade_select_lights) != 0u;
  float u = select ? sample_2d(path.key, path.index, pair_light(push.bounce)).x : 0.0f;
  EnvironmentRecord environment = scene.environments.at[path_environment(path)];
  LightChoice choice = vertex_light(scene.lights, environment, k, select, all_delta(path), u);
  request.probability = choice.probability;
  if (choice.probability == 0.0f) return request;
  LightRecord record = scene.lights.at[choice.index];
  request.projector = record.kind == light_projector;
  vec2 point = vec2(0.0f);
  if ((features & feature_lights) != 0u) {
    point = sample_2d(path.key, path.index, pair_light_point(push.bounce, k));
    position = shape_origin;
  }
  request.light = light_towards(scene, choice.index, position, point, path.time_s);
  if (request.light.pdf > 0.0f && (push.flags & shade_bsdf_only) != 0u) return request;
  bool mesh = (features & feature_lights) != 0u && record.kind == light_mesh;
  request.group = ambient_group(mesh ? request.light.light_group : record.light_group);
  request.found = max_component(request.light.irradiance) > 0.0f;
  return request;
}

/// Russian roulette by the largest channel of the throughput.
bool survives(INOUT(Path) path, float u) {
  float survival = max_component(path.throughput);
  if (push.bounce < 3u || survival >= 1.0f) return survival > 0.0f;
  path.throughput /= survival;
  return u < survival;
}

#include "stage/medium.glsl"
#include "stage/walk.glsl"

struct Shading {
  Path path;
  Vertex vertex;
  FogVertex fog;
  Walk walk;
  bool hit;  // and not beyond the last bounce
};

/// Adds the light of shapes that the ray meets before t_far.
void add_shapes(uint i, Path path, float t_far, bool open) {
  SceneAddresses scene = push.scene.at[0];
  EnvironmentRecord environment = scene.environments.at[path_environment(path)];
  vec3 origin = load_origin(i), direction = load_direction(push.rays_in, i, push.capacity);
  float t_near = uintBitsToFloat(ray_field(i, ray_t_near));
  for (uint k = environment.first_shape; k < environment.light_count; ++k) {
    uint index = environment.first_light + k;
    LightRecord light = scene.lights.at[index];
    ShapeHit hit = meet_moving_light(scene, index, origin, direction, path.time_s);
    if (!hit.found || hit.t < t_near || hit.t > t_far) continue;
    float weight = found_weight(path, index, hit.pdf);
    if (weight == 0.0f) continue;
    if (open) hit.radiance *= open_transmittance(origin, direction, hit.t);
    add_radiance(path.slot, ambient_group(light.light_group), path.throughput * hit.radiance * weight);
  }
}

/// What is left after a way that ended at this surface: the glass absorbs that the path is in, also before an immersed thing.
Spectrum absorbed(Path path, MaterialPoint m, bool front, float t) {
  Spectrum attenuation = !front && m.transmission > 0.0f ? m.attenuation : Spectrum(0.0f);
  if (path.body != 0u) {
    MaterialRecord body = push.scene.at[0].materials.at[path.body - 1u];
    attenuation = band_of(body.attenuation, body.ir_attenuation);
  }
  return band_exp(attenuation * -t);
}

/// The surface that ray i met; the path loses what the way inside absorbed, and gets the surface's emission.
Vertex load_vertex(uint i, INOUT(Path) path) {
  vec3 wo = -load_direction(push.rays_in, i, push.capacity);
  SceneAddresses scene = push.scene.at[0];
  Surface s = surface_at(scene, ray_field(i, hit_instance), ray_field(i, hit_primitive), uintBitsToFloat(ray_field(i, hit_u)),
                         uintBitsToFloat(ray_field(i, hit_v)), path.time_s);
  MaterialRecord record = scene.materials.at[s.material];
  MaterialPoint m = load_material(scene, record, s);
  bool front = dot(s.geometric_normal, wo) >= 0.0f;
  if ((features & feature_materials) != 0u) path.throughput *= absorbed(path, m, front, uintBitsToFloat(ray_field(i, ray_t_far)));
  if (max_component(m.emission) > 0.0f) {
    float weight = emission_weight(path, record, uintBitsToFloat(ray_field(i, ray_t_far)), dot(s.geometric_normal, wo));
    add_radiance(path.slot, ambient_group(record.light_group), path.throughput * m.emission * weight);
  }
  Vertex vertex;
  vertex.position = s.position;
  vertex.coordinate_size = s.coordinate_size;
  vertex.side_normal = front ? s.geometric_normal : -s.geometric_normal;
  vertex.body_beyond = front ? s.material + 1u : 0u;
  vec3 normal = front ? s.shading_normal : -s.shading_normal;
  // An interpolated normal may face away from the viewer, where GGX is not defined: bend it back. Lambert needs no viewer.
  float facing = dot(normal, wo);
  if (facing < 1e-3f && m.specular + m.metallic > 0.0f) normal = normalize(normal + (1e-3f - facing) * wo);
  vertex.frame = frame_around(normal);
  vertex.wo = to_local(vertex.frame, wo);
  vertex.bsdf = make_bsdf(m, scene.specular_albedo, vertex.wo.z, front);
  vertex.chances = lobe_chances(vertex.bsdf);
  return vertex;
}

Shading begin_shading(uint i) {
  Shading s;
  s.path = load_path(i);
  s.hit = ray_field(i, hit_geometry) != miss;
  s.fog.found = s.walk.inside = false;
  if (can_walk() && (s.path.flags & path_inside) != 0u) {
    s.hit = walk_on(i, s.path, s.walk, s.vertex) && depth(s.path) <= push.max_bounces;
    return s;
  }
  float t_far = s.hit ? uintBitsToFloat(ray_field(i, ray_t_far)) : infinite_m;
  bool open = in_medium() && !ran_inside(i, s.path);
  if ((features & feature_lights) != 0u) add_shapes(i, s.path, s.hit ? t_far : 2.0f * infinite_m, open);
  if (open) {
    vec3 origin = load_origin(i), direction = load_direction(push.rays_in, i, push.capacity);
    if (depth(s.path) <= push.max_bounces) s.fog = sample_fog(s.path, origin, direction, t_far);
    s.path.throughput *= open_transmittance(origin, direction, t_far);
  }
  if (s.hit) {
    s.vertex = load_vertex(i, s.path);
    s.hit = depth(s.path) <= push.max_bounces;
  } else {
    EnvironmentRecord environment = push.scene.at[0].environments.at[path_environment(s.path)];
    add_radiance(s.path.slot, ambient_group(environment.light_group), s.path.throughput * band_of(environment.radiance, environment.radiance.x));
  }
  return s;
}

/// Shadow rays of the surface; those of the fog follow.
uint surface_rays() { return in_medium() ? push.shadow_rays_per_vertex / 2u : push.shadow_rays_per_vertex; }

bool asks_light(IN(Shading) s, uint k) { return k < surface_rays() ? s.hit && takes_light(s.vertex.bsdf) : s.fog.found; }

ShadowRequest ask_light_at_surface(IN(Path) path, IN(Vertex) vertex, uint k) {
  ShadowRequest request;
  request.wanted = false;
  request.ray.origin = offset_origin(vertex.position, vertex.coordinate_size, vertex.side_normal);
  LightRequest asked = find_light(path, vertex.position, request.ray.origin, k);
  if (!asked.found) return request;
  bool behind = dot(asked.light.direction, vertex.side_normal) <= 0.0f;
  if (behind && !is_rough_glass(vertex.bsdf)) return request;
  if (behind) {
    request.ray.origin = offset_origin(vertex.position, vertex.coordinate_size, -vertex.side_normal);
    asked.light.distance_m -= vertex.coordinate_size * (1.0f / 65536.0f);  // nearer by both offsets
  }
  float pdf;
  vec3 wi = to_local(vertex.frame, asked.light.direction);
  if (behind == (wi.z > 0.0f)) return request;
  Spectrum f = bsdf_evaluate(vertex.bsdf, push.scene.at[0].specular_albedo, vertex.wo, wi, vertex.chances, pdf);
  request.contribution = path.throughput * f * asked.light.irradiance / asked.probability;
  if (in_medium()) request.contribution *= open_transmittance(request.ray.origin, asked.light.direction, asked.light.distance_m);
  request.opaque = asked.light.pdf > 0.0f;  // directions that find it go through glass by themselves
  if (request.opaque && (push.flags & shade_lights_only) == 0u) request.contribution *= mis_weight(asked.light.pdf * asked.probability, pdf);
  request.wanted = max_component(request.contribution) > 0.0f;
  request.group = !asked.projector ? asked.group : all_delta(path) ? group_projector_direct : group_projector_indirect;
  request.ray.t_near = 0.0f;
  request.ray.direction = asked.light.direction;
  request.ray.t_far = asked.light.distance_m * 0.99999f;
  return request;
}

/// The k-th shadow ray of the vertex, where asks_light.
ShadowRequest ask_light(IN(Shading) s, uint k) {
  if (in_medium() && k >= surface_rays()) return ask_light_in_fog(s.path, s.fog, k - surface_rays());
  return ask_light_at_surface(s.path, s.vertex, k);
}

/// Whether a further surface would be seen.
bool bounces_on(Path path) { return depth(path) < push.max_bounces || (push.flags & shade_ambient) != 0u; }

NextRequest scatter(INOUT(Shading) s) {
  NextRequest request;
  request.wanted = false;
  if (s.walk.inside) return wander(s.path, s.walk);
  bool roulette = push.bounce >= 3u;
  vec2 choice = vec2(0.0f);  // where there is nothing to choose, not drawn
  if (roulette || !s.hit || s.vertex.chances.x < 1.0f) choice = sample_2d(s.path.key, s.path.index, pair_choice(push.bounce));
  if (in_medium()) {
    float fogged = fog_chance(s.path, s.fog, s.hit);
    if (fogged == 1.0f || sample_2d(s.path.key, s.path.index, pair_fog_or_surface(push.bounce)).x < fogged) {
      request = scatter_in_fog(s.path, s.fog, fogged);
      leave_first(s.path);
      request.wanted = bounces_on(s.path) && survives(s.path, choice.y);
      return request;
    }
    s.path.throughput /= 1.0f - fogged;
  }
  if (can_walk() && s.vertex.bsdf.subsurface > 0.0f) {
    float below = 1.0f - (s.vertex.chances.x + s.vertex.chances.y + s.vertex.chances.z);
    if (choice.x >= 1.0f - below && below > 0.0f) {
      request = enter_body(s.path, s.vertex, s.vertex.bsdf.subsurface * (1.0f - s.vertex.bsdf.coat_albedo) / below);
      leave_first(s.path);
      return request;
    }
  }
  if (!bounces_on(s.path)) return request;
  vec2 u = sample_2d(s.path.key, s.path.index, pair_direction(push.bounce));
  BsdfSample b = bsdf_sample(s.vertex.bsdf, push.scene.at[0].specular_albedo, s.vertex.wo, s.vertex.chances, u, choice.x);
  vec3 direction = to_world(s.vertex.frame, b.direction);
  // The shading normal may send a ray to the wrong side of the triangle.
  if (b.transmitted == (dot(direction, s.vertex.side_normal) > 0.0f)) return request;
  s.path.throughput *= b.weight;
  s.path.pdf = b.pdf;
  if (!b.delta) leave_first(s.path);
  if (b.transmitted) s.path.body = s.vertex.body_beyond;
  request.wanted = survives(s.path, choice.y);
  vec3 outward = b.transmitted ? -s.vertex.side_normal : s.vertex.side_normal;
  request.ray = Ray(offset_origin(s.vertex.position, s.vertex.coordinate_size, outward), 0.0f, direction, uintBitsToFloat(0x7f800000u));
  return request;
}

bool goes_on(IN(Shading) s) {
  if (s.walk.inside) return s.walk.scattered;
  if (can_walk() && s.hit && s.vertex.bsdf.subsurface > 0.0f) return true;  // below the surface is no bounce
  return (s.hit || s.fog.found) && bounces_on(s.path);
}

void queue_shadow(Path path, ShadowRequest request, uint k, uint i) {
  if ((push.flags & shade_glass_shadows) != 0u) {
    store_closest_ray(push.shadow_rays, i, push.shadow_capacity, request.ray, path.time_s, request.opaque ? i | shadow_opaque : i);
    push.contributions.at[channels * push.shadow_capacity + i] = request.ray.t_far;
  } else {
    store_ray(push.shadow_rays, i, occlusion_words, push.shadow_capacity, request.ray, path.time_s, path.slot);
  }
  if ((push.flags & shade_environments) != 0u) push.shadow_environments.at[i] = path_environment(path);
  for (uint c = 0u; c < channels; ++c) push.contributions.at[c * push.shadow_capacity + i] = channel_of(request.contribution, c);
  push.state.at[plane(state_shadow(channels, push.groups) + k, path.slot)] = i | (request.group << shadow_group_shift);
}

void queue_no_shadow(Path path, uint k) { push.state.at[plane(state_shadow(channels, push.groups) + k, path.slot)] = shadow_none; }

void queue_next(Path path, NextRequest request, uint i) {
  store_closest_ray(push.rays_out, i, push.capacity, request.ray, path.time_s, path.slot);
  if ((push.flags & shade_environments) != 0u) push.ray_environments.at[i] = path_environment(path);
  store_path(path);
}
