// SPDX-License-Identifier: Apache-2.0
// Stage `gather`, before `shade` and on its records (stage/path.glsl, vertex_light.glsl, medium.glsl, vertex.glsl): where a path arrived, the light that bodies of
// smooth glass have bent towards it (stage/follow.glsl).
#include "lib/splat_table.glsl"

#include "stage/gather_splats.glsl"

/// f cos towards a direction.
Spectrum scattered_towards(IN(Vertex) vertex, vec3 direction) {
  vec3 wi = to_local(vertex.frame, direction);
  bool behind = dot(direction, vertex.side_normal) <= 0.0f;
  if (behind != (wi.z <= 0.0f) || (behind && !takes_light_behind(vertex.bsdf))) return Spectrum(0.0f);
  float pdf;
  return bsdf_evaluate(vertex.bsdf, push.scene.at[0].specular_albedo, vertex.wo, wi, vertex.chances, pdf);
}

/// Of a path that arrived: what is left of it, and the surface.
void meet_lit_surface(uint i, float t, INOUT(Path) path, OUT(Vertex) vertex) {
  if (in_medium() && !ran_inside(i, path)) path.throughput *= path_transmittance(load_origin(i), load_direction(push.rays_in, i, push.capacity), t);
  meet_surface(i, path.time_s, vertex);
  if ((features & feature_materials) != 0u) path.throughput *= absorbed(path, vertex.material, vertex.front, t);
  if ((features & feature_dispersion) != 0u) vertex.material.carries = path.throughput;
  set_bsdf(vertex);
}

/// A path that arrived where light may have landed.
struct Gathering {
  bool wanted;
  Path path;
  vec3 position;
  float t;       // of its ray
  float weight;  // 1 over the chance of looking at all
};

Gathering begin_gathering(uint i) {
  Gathering g;
  g.wanted = false;
  if (ray_field(i, hit_geometry) == miss) return g;
  g.path = load_path(i);
  if ((g.path.flags & path_inside) != 0u || depth(g.path) > push.max_bounces) return g;
  // Most vertices behind a rough surface bring little each: of four, one looks.
  g.weight = 1.0f;
  if (!all_delta(g.path)) {
    const float chance = 0.25f;
    if (sample_2d(g.path.key, g.path.index, pair_splat(push.bounce, 0u)).y >= chance) return g;
    g.weight = 1.0f / chance;
  }
  g.t = uintBitsToFloat(ray_field(i, ray_t_far));
  g.position = load_origin(i) + load_direction(push.rays_in, i, push.capacity) * g.t;
  g.wanted = true;
  return g;
}

/// Lights that a vertex asks.
uint gathered_lights() { return in_medium() ? push.shadow_rays_per_vertex / 2u : push.shadow_rays_per_vertex; }

LightChoice gathered_light(IN(Gathering) g, uint k) {
  IN(SceneAddresses) scene = push.scene.at[0];
  bool select = (push.flags & shade_select_lights) != 0u;
  float u = select ? sample_2d(g.path.key, g.path.index, pair_light(push.bounce)).x : 0.0f;
  return vertex_light(scene.lights, scene.environments.at[path_environment(g.path)], k, select, all_delta(g.path), u);
}

void gather(uint i, INOUT(Gathering) g) {
  IN(SceneAddresses) scene = push.scene.at[0];
  bool met = false;
  Vertex vertex;
  for (uint k = 0u; k < gathered_lights(); ++k) {
    LightChoice choice = gathered_light(g, k);
    if (choice.probability == 0.0f) continue;
    float random = sample_2d(g.path.key, g.path.index, pair_splat(push.bounce, k)).x;
    Gathered found = gather_about(g.position, choice.index, path_environment(g.path), random);
    if (found.total == 0.0f) continue;
    vec2 point = vec2(0.0f);
    if ((features & feature_lights) != 0u) point = sample_2d(g.path.key, g.path.index, pair_light_point(push.bounce, k));
    Spectrum arriving = light_towards(scene, choice.index, found.lit, point, g.path.time_s).irradiance * found.gain * (found.total * g.weight / choice.probability);
    if (max_component(arriving) == 0.0f) continue;
    if (!met) meet_lit_surface(i, g.t, g.path, vertex);
    met = true;
    IN(LightRecord) light = scene.lights.at[choice.index];
    uint group = light.kind != light_projector ? ambient_group(light.light_group, depth(g.path) + 1u) : all_delta(g.path) ? group_projector_direct : group_projector_indirect;
    add_radiance(g.path.slot, group, g.path.throughput * arriving * scattered_towards(vertex, found.direction));
  }
}
