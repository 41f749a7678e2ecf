// SPDX-License-Identifier: Apache-2.0
// Stage `shade`: what a path does where its ray ended. Light that is simply there (environment, emission) is added; for each light one shadow ray is asked
// for; the BSDF gives the next ray. The caller queues both.
#include "stage/path.glsl"
#include "stage/vertex_light.glsl"
#include "stage/medium.glsl"
#include "stage/vertex.glsl"
#include "stage/walk.glsl"

struct Shading {
  Path path;
  Vertex vertex;
  FogVertex fog;
  Walk walk;
  bool hit;  // and not beyond the last bounce
};

/// The light that is there where a path meets nothing.
void add_environment(IN(Path) path) {
  IN(EnvironmentRecord) environment = push.scene.at[0].environments.at[path_environment(path)];
  add_radiance(path.slot, ambient_group(environment.light_group, depth(path)), path.throughput * band_of(environment.radiance));
}

/// Everything up to the BSDF of the surface.
void arrive(uint i, OUT(Shading) s) {
  s.path = load_path(i);
  s.hit = ray_field(i, hit_geometry) != miss;
  s.fog.found = s.walk.inside = false;
  if (can_walk() && (s.path.flags & path_inside) != 0u) {
    s.hit = walk_on(i, s.path, s.walk, s.vertex) && depth(s.path) <= push.max_bounces;
    return;
  }
  float t_far = s.hit ? uintBitsToFloat(ray_field(i, ray_t_far)) : infinite_m;
  bool open = in_medium() && !ran_inside(i, s.path);
  if ((features & feature_lights) != 0u) add_shapes(i, s.path, s.hit ? t_far : 2.0f * infinite_m, open);
  if (open) {
    vec3 origin = load_origin(i), direction = load_direction(push.rays_in, i, push.capacity);
    if (depth(s.path) <= push.max_bounces) s.fog = sample_fog(s.path, origin, direction, t_far);
    s.path.throughput *= path_transmittance(origin, direction, t_far);
  }
  if (s.hit) {
    load_vertex(i, s.path, s.vertex);
    s.hit = depth(s.path) <= push.max_bounces;
  } else {
    add_environment(s.path);
  }
}

Shading begin_shading(uint i) {
  Shading s;
  arrive(i, s);
  if (s.hit) set_bsdf(s.vertex);
  return s;
}

/// Shadow rays of the surface; those of the fog follow.
uint surface_rays() { return in_medium() ? push.shadow_rays_per_vertex / 2u : push.shadow_rays_per_vertex; }

bool asks_light(IN(Shading) s, uint k) { return k < surface_rays() ? s.hit && takes_light(s.vertex.bsdf) : s.fog.found; }

/// The k-th light from where the surface is; what the BSDF makes of it completes the request.
struct LightAtSurface {
  bool found;
  vec3 wi;  // local
  LightRequest asked;
  vec3 origin;  // of the shadow ray
};

/// From which side the light reaches the surface.
void turn_to_light(IN(Vertex) vertex, INOUT(LightAtSurface) l) {
  bool behind = dot(l.asked.light.direction, vertex.side_normal) <= 0.0f;
  if (behind) {
    l.origin = offset_origin(vertex.position, vertex.coordinate_size, -vertex.side_normal);
    l.asked.light.distance_m -= vertex.coordinate_size * (1.0f / 65536.0f);  // nearer by both offsets
  }
  l.wi = to_local(vertex.frame, l.asked.light.direction);
  l.found = behind != (l.wi.z > 0.0f);
}

void light_at_surface(IN(Path) path, IN(Vertex) vertex, uint k, OUT(LightAtSurface) l) {
  l.origin = offset_origin(vertex.position, vertex.coordinate_size, vertex.side_normal);
  l.found = false;
  find_light(path, vertex.position, l.origin, k, l.asked);
  if (!l.asked.found) return;
  turn_to_light(vertex, l);
}

/// f, pdf: of bsdf_evaluate for the light's direction.
void request_light(IN(Path) path, IN(LightAtSurface) l, Spectrum f, float pdf, OUT(ShadowRequest) request) {
  request.contribution = path.throughput * f * l.asked.light.irradiance / l.asked.probability;
  if (in_medium()) request.contribution *= open_transmittance(l.origin, l.asked.light.direction, l.asked.light.distance_m);
  request.opaque = l.asked.light.pdf > 0.0f;  // directions that find it go through glass by themselves
  if (request.opaque && (push.flags & shade_lights_only) == 0u) request.contribution *= mis_weight(l.asked.light.pdf * l.asked.probability, pdf);
  request.wanted = max_component(request.contribution) > 0.0f;
  request.bent = (push.flags & shade_bends) != 0u && !request.opaque;
  request.group = !l.asked.projector ? l.asked.group : all_delta(path) ? group_projector_direct : group_projector_indirect;
  request.ray = Ray(l.origin, 0.0f, l.asked.light.direction, l.asked.light.distance_m * 0.99999f);
}

ShadowRequest ask_light_at_surface(IN(Path) path, IN(Vertex) vertex, uint k) {
  ShadowRequest request = no_shadow_request();
  LightAtSurface l;
  light_at_surface(path, vertex, k, l);
  if (!l.found || (l.wi.z <= 0.0f && !takes_light_behind(vertex.bsdf))) return request;
  float pdf;
  Spectrum f = bsdf_evaluate(vertex.bsdf, push.scene.at[0].specular_albedo, vertex.wo, l.wi, vertex.chances, pdf);
  request_light(path, l, f, pdf, request);
  if (can_walk() && vertex.from_below) request.bent = false;  // `gather` does not know the surface from below
  return request;
}

/// The k-th shadow ray of the vertex, where asks_light.
ShadowRequest ask_light(IN(Shading) s, uint k) {
  if (in_medium() && k >= surface_rays()) return ask_light_in_fog(s.path, s.fog, k - surface_rays());
  return ask_light_at_surface(s.path, s.vertex, k);
}

/// Whether a further surface would be seen.
bool bounces_on(IN(Path) path) { return depth(path) < push.max_bounces || (push.flags & shade_ambient) != 0u; }

/// Where the BSDF's sample takes the path; roulette: a random number.
NextRequest go_on(INOUT(Path) path, IN(Vertex) vertex, IN(BsdfSample) b, float roulette) {
  NextRequest request = no_next_request();
  vec3 direction = to_world(vertex.frame, b.direction);
  // The shading normal may send a ray to the wrong side of the triangle.
  bool right_side = b.transmitted != (dot(direction, vertex.side_normal) > 0.0f);
  path.throughput *= b.weight;
  path.pdf = b.pdf;
  if (!b.delta) leave_first(path);
  if (b.transmitted) path.body = vertex.body_beyond;
  request.wanted = survives(path, roulette) && right_side;
  vec3 outward = vertex.side_normal * (b.transmitted ? -1.0f : 1.0f);
  request.ray = Ray(offset_origin(vertex.position, vertex.coordinate_size, outward), 0.0f, direction, uintBitsToFloat(0x7f800000u));
  return request;
}

NextRequest scatter(INOUT(Shading) s) {
  NextRequest request = no_next_request();
  if (s.walk.inside) return wander(s.path, s.walk);
  bool roulette = push.bounce >= first_roulette;
  vec2 choice = vec2(0.0f);  // where there is nothing to choose, not drawn
  if (roulette || !s.hit || s.vertex.chances.x < 1.0f || base_has_parts(s.vertex.bsdf)) choice = sample_2d(s.path.key, s.path.index, pair_choice(push.bounce));
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
    if (wears_clearcoat(s.vertex.bsdf.clearcoat)) below -= s.vertex.bsdf.clearcoat.chance;
    if (choice.x >= 1.0f - below && below > 0.0f) {
      request = enter_body(s.path, s.vertex, s.vertex.bsdf.subsurface * left_for_base(s.vertex.bsdf.coat_albedo, s.vertex.bsdf.sheen) / below);
      leave_first(s.path);
      return request;
    }
  }
  if (!bounces_on(s.path)) return request;
  vec2 u = sample_2d(s.path.key, s.path.index, pair_direction(push.bounce));
  BsdfSample b = bsdf_sample(s.vertex.bsdf, push.scene.at[0].specular_albedo, s.vertex.wo, s.vertex.chances, u, choice.x);
  return go_on(s.path, s.vertex, b, choice.y);
}

bool goes_on(IN(Shading) s) {
  if (s.walk.inside) return s.walk.scattered;
  if (can_walk() && s.hit && s.vertex.bsdf.subsurface > 0.0f) return true;  // below the surface is no bounce
  return (s.hit || s.fog.found) && bounces_on(s.path);
}

/// What was asked for goes to the places in the queues that the caller found.
void queue_shadow(IN(Path) path, IN(ShadowRequest) request, uint k, uint i) {
  uint id = i | (request.opaque ? shadow_opaque : 0u) | (request.bent ? shadow_bent : 0u);
  if ((push.flags & shade_glass_shadows) != 0u) {
    store_closest_ray(push.shadow_rays, i, push.shadow_capacity, request.ray, path.time_s, id);
    push.contributions.at[channels * push.shadow_capacity + i] = request.ray.t_far;
  } else {
    store_ray(push.shadow_rays, i, occlusion_words, push.shadow_capacity, request.ray, path.time_s, id);
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
