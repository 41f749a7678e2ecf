// SPDX-License-Identifier: Apache-2.0
// Light at a vertex of stage `shade`: asked for by a shadow ray, before visibility, or found by the path's own ray and weighted against the light samples that
// might have found it.
/// A light that a vertex asks, before visibility.
struct LightRequest {
  bool found;
  float probability;  // of this light among all
  bool projector;
  uint group;  // of light that is no projector's
  LightSample light;
};

struct ShadowRequest {
  bool wanted;
  bool opaque;  // glass stops it
  bool bent;    // glass of bodies stops it: what they bend is gathered (stage/gather.glsl)
  Ray ray;
  Spectrum contribution;
  uint group;
};

ShadowRequest no_shadow_request() { return ShadowRequest(false, false, false, empty_ray(), Spectrum(0.0f), 0u); }

void find_light(IN(Path) path, vec3 position, vec3 shape_origin, uint k, OUT(LightRequest) request) {
  request.found = false;
  IN(SceneAddresses) scene = push.scene.at[0];
  bool select = (push.flags & shade_select_lights) != 0u;
  float u = select ? sample_2d(path.key, path.index, pair_light(push.bounce)).x : 0.0f;
  IN(EnvironmentRecord) environment = scene.environments.at[path_environment(path)];
  LightChoice choice = vertex_light(scene.lights, environment, k, select, all_delta(path), u);
  request.probability = choice.probability;
  if (choice.probability == 0.0f) return;
  IN(LightRecord) record = scene.lights.at[choice.index];
  if (record.kind == light_mesh && (push.flags & shade_bsdf_only) != 0u) return;  // the path's own ray finds it, and a sample of it takes long
  request.projector = record.kind == light_projector;
  vec2 point = vec2(0.0f);
  if ((features & feature_lights) != 0u) {
    point = sample_2d(path.key, path.index, pair_light_point(push.bounce, k));
    position = shape_origin;
  }
  request.light = light_towards(scene, choice.index, position, point, path.time_s);
  if (request.light.pdf > 0.0f && (push.flags & shade_bsdf_only) != 0u) return;
  bool mesh = (features & feature_lights) != 0u && record.kind == light_mesh;
  request.group = ambient_group(mesh ? request.light.light_group : record.light_group, depth(path) + 1u);
  request.found = max_component(request.light.irradiance) > 0.0f;
}

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
